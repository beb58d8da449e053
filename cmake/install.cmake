# cmake --install, the CMake package and the pkg-config file. A project that includes cairn as a subfolder gets no
# install rules from it.
option(CAIRN_INSTALL "Make install rules" ${PROJECT_IS_TOP_LEVEL})
if(NOT CAIRN_INSTALL)
  return()
endif()
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# Headers alone: nothing depends on the architecture, so everything else goes to share. cairn::compiled does, where it is asked for.
if(CAIRN_COMPILED AND TARGET cairn_compiled)
  set(config_folder "${CMAKE_INSTALL_LIBDIR}/cmake/cairn")
  set(independent "")
  install(TARGETS cairn_compiled EXPORT cairn_compiled_targets ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}")
  install(EXPORT cairn_compiled_targets NAMESPACE cairn:: DESTINATION "${config_folder}" FILE cairn-compiled-targets.cmake)
else()
  set(config_folder "${CMAKE_INSTALL_DATADIR}/cmake/cairn")
  set(independent ARCH_INDEPENDENT)
endif()
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/cairn" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" FILES_MATCHING PATTERN "*.hpp")
# Two sets, so that the one that names Eigen3::Eigen is read only where that is.
install(TARGETS cairn_index EXPORT cairn_index_targets INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(TARGETS cairn EXPORT cairn_targets)
foreach(set IN ITEMS cairn_index cairn)
  string(REPLACE "_" "-" file "${set}-targets.cmake")
  install(EXPORT ${set}_targets NAMESPACE cairn:: DESTINATION "${config_folder}" FILE "${file}")
endforeach()

configure_package_config_file(cmake/cairn-config.cmake.in "${PROJECT_BINARY_DIR}/cairn-config.cmake"
  INSTALL_DESTINATION "${config_folder}")
# Before 1.0 a minor version may change the interface: 0.1 does not stand in for 0.2.
write_basic_package_version_file("${PROJECT_BINARY_DIR}/cairn-config-version.cmake"
  COMPATIBILITY SameMinorVersion ${independent})
install(FILES "${PROJECT_BINARY_DIR}/cairn-config.cmake" "${PROJECT_BINARY_DIR}/cairn-config-version.cmake"
  DESTINATION "${config_folder}")

foreach(package IN ITEMS cairn cairn-index)
  configure_file(cmake/${package}.pc.in "${PROJECT_BINARY_DIR}/${package}.pc" @ONLY)
  install(FILES "${PROJECT_BINARY_DIR}/${package}.pc" DESTINATION "${CMAKE_INSTALL_DATADIR}/pkgconfig")
endforeach()
install(FILES LICENSE DESTINATION "${CMAKE_INSTALL_DATADIR}/licenses/cairn")
