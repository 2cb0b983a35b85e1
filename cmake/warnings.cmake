# SPDX-License-Identifier: Apache-2.0
add_library(langgs_warnings INTERFACE)
target_compile_options(
  langgs_warnings INTERFACE -Wall -Wextra -Wconversion -Wno-sign-conversion -Wshadow -Wpedantic
                            -Wno-missing-field-initializers $<$<BOOL:${LANGGS_WARNINGS_AS_ERRORS}>:-Werror>)
