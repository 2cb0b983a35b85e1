// SPDX-License-Identifier: Apache-2.0
#include "render/topk_test.inc"
