# SPDX-License-Identifier: Apache-2.0
option(LANGGS_WARNINGS_AS_ERRORS "Warnings in our own programs are errors" ${langgs_is_top_level})

add_library(langgs_warnings INTERFACE)
target_compile_options(
  langgs_warnings
  INTERFACE -Wall -Wextra -Wconversion -Wno-sign-conversion -Wshadow -Wpedantic -Wno-missing-field-initializers
            $<$<BOOL:${LANGGS_WARNINGS_AS_ERRORS}>:-Werror>)
# g++ 12 takes the _mm512_undefined_* idiom of its own avx512fintrin.h for a use of an uninitialised variable, wherever
# Eigen is inlined (GCC bug 105593), and sees an overlap in its own std::string's `"..." + string` (GCC bug 105651).
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  target_compile_options(langgs_warnings INTERFACE -Wno-maybe-uninitialized -Wno-uninitialized -Wno-restrict)
endif()
