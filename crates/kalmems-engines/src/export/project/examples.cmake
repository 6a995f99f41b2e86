
# Neither the examples nor the test are part of a larger project.
if(CMAKE_SOURCE_DIR STREQUAL PROJECT_SOURCE_DIR)
  enable_testing()
  add_executable(run example/main.c@self_test_source@)
  add_executable(interrupt example/interrupt.c)
  target_link_libraries(run PRIVATE kalmems_@name@)
  target_link_libraries(interrupt PRIVATE kalmems_@name@)@self_test@
endif()
