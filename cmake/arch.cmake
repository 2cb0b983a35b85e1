# SPDX-License-Identifier: Apache-2.0
# nvcc's front end breaks off at vectors of 64 bytes, and files for different machines do not mix: with CUDA, the default.
set(langgs_default_arch native)
if(LANGGS_ENABLE_CUDA)
  set(langgs_default_arch "")
endif()
set(LANGGS_ARCH "${langgs_default_arch}" CACHE STRING "Value of -march for our own programs; empty: the compiler's default")
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
