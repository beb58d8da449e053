# What the rows about vision need: libpng for the photographs, and of the rivals whichever are found.
find_package(PNG REQUIRED)
find_package(OpenCV 4 QUIET COMPONENTS core features2d imgcodecs)
find_package(dlib QUIET CONFIG)

target_link_libraries(scoreboard_vision_geometry PRIVATE PNG::PNG)
target_compile_definitions(scoreboard_vision_geometry PRIVATE
  CAIRN_BENCH_HAS_OPENCV=$<BOOL:${OpenCV_FOUND}> CAIRN_BENCH_HAS_DLIB=$<BOOL:${dlib_FOUND}>)
if(OpenCV_FOUND)
  target_include_directories(scoreboard_vision_geometry SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
  target_link_libraries(scoreboard_vision_geometry PRIVATE opencv_core opencv_features2d opencv_imgcodecs)
endif()
if(dlib_FOUND)
  target_include_directories(scoreboard_vision_geometry SYSTEM PRIVATE
    $<TARGET_PROPERTY:dlib::dlib,INTERFACE_INCLUDE_DIRECTORIES>)
  target_link_libraries(scoreboard_vision_geometry PRIVATE dlib::dlib)
endif()
