# SPDX-License-Identifier: Apache-2.0
# The library itself: an include directory, C++20 and its dependencies.
file(GLOB_RECURSE langgs_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/include/langgs/*.hpp"
     "${PROJECT_SOURCE_DIR}/include/langgs/*.cuh")

add_library(langgs INTERFACE)
add_library(langgs::langgs ALIAS langgs)
target_compile_features(langgs INTERFACE cxx_std_20)
target_link_libraries(langgs INTERFACE Eigen3::Eigen nanoflann::nanoflann langgs::thrust Threads::Threads)

if(CMAKE_VERSION VERSION_GREATER_EQUAL 3.23)
  target_sources(langgs INTERFACE FILE_SET HEADERS BASE_DIRS "${PROJECT_SOURCE_DIR}/include" FILES ${langgs_headers})
else()
  target_include_directories(langgs INTERFACE "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>"
                                              "$<INSTALL_INTERFACE:include>")
endif()
