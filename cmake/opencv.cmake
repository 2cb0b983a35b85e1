# SPDX-License-Identifier: Apache-2.0
# langgs_opencv: the three OpenCV modules that the examples use, or no target at all. Debian's OpenCVConfig.cmake comes
# with libopencv-dev, which wants a hundred packages more than the three module packages: so look for the modules.
find_path(LANGGS_OPENCV_INCLUDE_DIR opencv2/imgcodecs.hpp PATH_SUFFIXES opencv4)
set(opencv_libraries "")
foreach(module core imgproc imgcodecs)
  find_library(LANGGS_OPENCV_${module} opencv_${module})
  list(APPEND opencv_libraries "${LANGGS_OPENCV_${module}}")
endforeach()
if(LANGGS_OPENCV_INCLUDE_DIR AND NOT opencv_libraries MATCHES "NOTFOUND")
  add_library(langgs_opencv INTERFACE)
  target_include_directories(langgs_opencv SYSTEM INTERFACE "${LANGGS_OPENCV_INCLUDE_DIR}")
  target_link_libraries(langgs_opencv INTERFACE ${opencv_libraries})
endif()
