# SPDX-License-Identifier: Apache-2.0
# What langgs::langgs needs. A parent project may bring its own targets of these names.
if(NOT TARGET Eigen3::Eigen)
  find_package(Eigen3 3.4 REQUIRED NO_MODULE)
endif()
if(NOT TARGET nanoflann::nanoflann)
  find_package(nanoflann REQUIRED)
endif()
if(NOT TARGET Threads::Threads)
  find_package(Threads REQUIRED)
endif()
include("${CMAKE_CURRENT_LIST_DIR}/langgsThrust.cmake")
