# SPDX-License-Identifier: Apache-2.0
# `cmake --install` and find_package(langgs).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(langgs_package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/langgs")
if(CMAKE_VERSION VERSION_GREATER_EQUAL 3.23)
  install(TARGETS langgs EXPORT langgsTargets FILE_SET HEADERS DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
else()
  install(TARGETS langgs EXPORT langgsTargets)
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/langgs" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
endif()
install(EXPORT langgsTargets NAMESPACE langgs:: DESTINATION "${langgs_package_dir}")

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/langgsConfig.cmake.in"
                              "${PROJECT_BINARY_DIR}/langgsConfig.cmake" INSTALL_DESTINATION "${langgs_package_dir}")
# Before 1.0 a minor version may break its users.
write_basic_package_version_file("${PROJECT_BINARY_DIR}/langgsConfigVersion.cmake" COMPATIBILITY SameMinorVersion
                                 ARCH_INDEPENDENT)
install(FILES "${PROJECT_BINARY_DIR}/langgsConfig.cmake" "${PROJECT_BINARY_DIR}/langgsConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/langgsThrust.cmake" "${PROJECT_SOURCE_DIR}/cmake/langgsCuda.cmake"
        DESTINATION "${langgs_package_dir}")
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}")
