// SPDX-License-Identifier: Apache-2.0
#include "optimize/feature_formula_test.inc"
