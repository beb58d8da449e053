# Target package_source: cairn-<version>.tar.gz in the build folder, holding the committed files and doctest.h, so that the
# archive tests itself on a machine without doctest.
find_program(CAIRN_GIT git)
find_path(CAIRN_DOCTEST_HEADER_FOLDER doctest/doctest.h)
mark_as_advanced(CAIRN_GIT CAIRN_DOCTEST_HEADER_FOLDER)
if(NOT CAIRN_GIT OR NOT CAIRN_DOCTEST_HEADER_FOLDER OR NOT EXISTS "${PROJECT_SOURCE_DIR}/.git")
  return()
endif()
set(archive_root "cairn-${PROJECT_VERSION}")
add_custom_target(package_source
  COMMAND "${CAIRN_GIT}" archive --output "${PROJECT_BINARY_DIR}/${archive_root}.tar.gz"
    "--prefix=${archive_root}/third_party/doctest/doctest/"
    "--add-file=${CAIRN_DOCTEST_HEADER_FOLDER}/doctest/doctest.h"
    "--prefix=${archive_root}/" HEAD
  WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}" VERBATIM
  COMMENT "Packing ${archive_root}.tar.gz")
