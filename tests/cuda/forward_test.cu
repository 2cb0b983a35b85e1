// SPDX-License-Identifier: Apache-2.0
#include "render/forward_test.inc"
