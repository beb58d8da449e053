# A machine without Eigen: cairn is installed there, its indices and image features are found, included as a folder and by
# pkg-config, and who asks for everything is told what is missing.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")
set(hidden -D CMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON)
install_cairn(${hidden})
configure("${project}" "${work}/installed" ${hidden} -D "CMAKE_PREFIX_PATH=${prefix}" -D "cairn_version=${version}"
  -D cairn_component=index)
build_and_run("${work}/installed")
configure("${project}" "${work}/folder" ${hidden} -D "cairn_folder=${source}" -D cairn_component=index)
build_and_run("${work}/folder")

function(expect_refusal words)
  execute_process(COMMAND "${CMAKE_COMMAND}" -S "${project}" -B "${work}/refused" -G "${generator}" ${hidden}
      -D "CMAKE_CXX_COMPILER=${compiler}" -D "CMAKE_PREFIX_PATH=${prefix}" -D "cairn_version=${version}" ${ARGN}
    RESULT_VARIABLE status ERROR_VARIABLE message OUTPUT_QUIET)
  string(REGEX REPLACE "[ \n]+" " " message "${message}")
  if(status EQUAL 0 OR NOT message MATCHES "${words}")
    message(FATAL_ERROR "${ARGN}: '${words}' was expected, but CMake says: ${message}")
  endif()
  file(REMOVE_RECURSE "${work}/refused")
endfunction()
expect_refusal("Eigen 3.4 or later was not found.*COMPONENTS index")
expect_refusal("Eigen 3.4 or later was not found" -D cairn_component=cairn)
expect_refusal("no component 'indices'.*index, cairn" -D cairn_component=indices)
expect_refusal("Eigen3::Eigen" -D "cairn_folder=${source}")

find_program(pkg_config pkg-config)
if(pkg_config)
  set(ENV{PKG_CONFIG_PATH} "${prefix}/share/pkgconfig")
  set(ENV{PKG_CONFIG_LIBDIR} "${work}")  # nothing else of this machine
  execute_process(COMMAND "${pkg_config}" --cflags "cairn-index = ${version}"
    OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags)
  file(WRITE "${work}/every_header.hpp" "#include <cairn/index/points.hpp>\n")
  run("${compiler}" ${flags} "-I${work}" "${project}/main.cpp" "${project}/other.cpp" -o "${work}/program")
  run("${work}/program")
  execute_process(COMMAND "${pkg_config}" --cflags cairn RESULT_VARIABLE status ERROR_VARIABLE message OUTPUT_QUIET)
  if(status EQUAL 0 OR NOT message MATCHES "eigen3")
    message(FATAL_ERROR "pkg-config should ask for eigen3, but says: ${message}")
  endif()
endif()
