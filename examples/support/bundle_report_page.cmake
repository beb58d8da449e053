# cmake -DNODE= -DNPM= -DPAGE= -DWORK= -DSOURCE= -DSTAMP= -P bundle_report_page.cmake
# Installs the packages of PAGE/package-lock.json into WORK (once for each version of the lock file), bundles the page and
# writes it to SOURCE. Where that cannot be done, SOURCE holds an empty page and STAMP is not made; the build goes on.

function(write_empty_page why)
  message("The examples will write no report.html: ${why}")
  file(CONFIGURE OUTPUT "${SOURCE}" @ONLY CONTENT [[
#include "report_template.hpp"
std::string_view example::report_template() noexcept { return {}; }
]])
endfunction()

if(NOT NODE OR NOT NPM)
  write_empty_page("node and npm not found (Debian: nodejs npm)")
  file(TOUCH "${STAMP}")  # another configure run finds them, and the command line changes
  return()
endif()

file(MAKE_DIRECTORY "${WORK}")
file(SHA256 "${PAGE}/package-lock.json" lock)
set(installed "${WORK}/installed")
set(installed_lock "")
if(EXISTS "${installed}")
  file(READ "${installed}" installed_lock)
endif()
if(NOT installed_lock STREQUAL lock)
  file(REMOVE "${installed}")
  file(COPY "${PAGE}/package.json" "${PAGE}/package-lock.json" "${PAGE}/.npmrc" DESTINATION "${WORK}")
  execute_process(COMMAND "${NPM}" ci --ignore-scripts --prefer-offline --fetch-retries=1 --fetch-retry-mintimeout=1000 --loglevel=error
    WORKING_DIRECTORY "${WORK}" TIMEOUT 300 RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(failed)
    file(WRITE "${WORK}/npm.log" "${output}")
    write_empty_page("npm ci failed, is there a network? (${WORK}/npm.log)")
    return()
  endif()
  file(WRITE "${installed}" "${lock}")
endif()

execute_process(COMMAND "${NODE}" "${PAGE}/build.mjs" "${WORK}/node_modules" "${SOURCE}"
  TIMEOUT 120 RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(failed)
  message(FATAL_ERROR "The report page cannot be bundled:\n${output}")
endif()
file(TOUCH "${STAMP}")
