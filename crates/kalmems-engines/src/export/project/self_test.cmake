
  add_executable(self_test example/self_test.c example/@name@_self_test.c)
  target_link_libraries(self_test PRIVATE kalmems_@name@)
  add_test(NAME self_test COMMAND self_test)
