# SPDX-License-Identifier: Apache-2.0
set(LANGGS_ARCH native CACHE STRING "Value of -march for our own programs; empty: the compiler's default")
include(CheckCXXCompilerFlag)

add_library(langgs_arch INTERFACE)
if(LANGGS_ARCH)
  string(MAKE_C_IDENTIFIER "LANGGS_HAS_MARCH_${LANGGS_ARCH}" check)
  check_cxx_compiler_flag("-march=${LANGGS_ARCH}" ${check})
  if(${check})
    target_compile_options(langgs_arch INTERFACE "-march=${LANGGS_ARCH}")
  else()
    message(WARNING "${CMAKE_CXX_COMPILER} does not know -march=${LANGGS_ARCH}; building for its default machine")
  endif()
endif()
