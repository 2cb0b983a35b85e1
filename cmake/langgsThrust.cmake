# SPDX-License-Identifier: Apache-2.0
# Thrust's headers: the CUDA toolkit's CCCL if there is one, else the system's (Debian: libthrust-dev).
if(NOT TARGET langgs::thrust)
  find_path(LANGGS_THRUST_INCLUDE_DIR thrust/sort.h HINTS "${CUDAToolkit_ROOT}/include/cccl"
            DOC "Folder that holds thrust/sort.h")
  mark_as_advanced(LANGGS_THRUST_INCLUDE_DIR)
  if(NOT LANGGS_THRUST_INCLUDE_DIR)
    message(FATAL_ERROR "thrust/sort.h was not found. Install libthrust-dev (Debian, Ubuntu), or point "
                        "LANGGS_THRUST_INCLUDE_DIR at the include/cccl folder of a CUDA toolkit")
  endif()
  add_library(langgs::thrust INTERFACE IMPORTED GLOBAL)
  if(NOT LANGGS_THRUST_INCLUDE_DIR STREQUAL "/usr/include")
    target_include_directories(langgs::thrust SYSTEM INTERFACE "${LANGGS_THRUST_INCLUDE_DIR}")
  endif()
endif()
