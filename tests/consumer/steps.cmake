# Steps that the consumer tests share. A step that fails ends the test.
set(prefix "${work}/prefix")
set(project "${CMAKE_CURRENT_LIST_DIR}/project")
file(REMOVE_RECURSE "${work}")
file(MAKE_DIRECTORY "${work}")

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

function(configure from to)
  run("${CMAKE_COMMAND}" -S "${from}" -B "${to}" -G "${generator}" -D "CMAKE_CXX_COMPILER=${compiler}" ${ARGN})
endfunction()

# Installs cairn into ${prefix} the way a packager does: nothing of its own is built.
function(install_cairn)
  configure("${source}" "${work}/cairn" -D CAIRN_BUILD_TESTS=OFF -D CAIRN_BUILD_EXAMPLES=OFF ${ARGN})
  run("${CMAKE_COMMAND}" --install "${work}/cairn" --prefix "${prefix}")
endfunction()

function(build_and_run folder)
  run("${CMAKE_COMMAND}" --build "${folder}")
  run("${folder}/program")
endfunction()
