// SPDX-License-Identifier: Apache-2.0
#include "render/backward_test.inc"
