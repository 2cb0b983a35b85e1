// SPDX-License-Identifier: Apache-2.0
#include "optimize/adam_test.inc"
