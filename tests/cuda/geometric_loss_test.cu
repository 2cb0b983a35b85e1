// SPDX-License-Identifier: Apache-2.0
#include "optimize/geometric_loss_test.inc"
