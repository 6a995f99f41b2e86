# kalmems::kalmems is the shared library, kalmems::static the static one.
get_filename_component(kalmems_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

if(NOT TARGET kalmems::kalmems)
  add_library(kalmems::kalmems SHARED IMPORTED)
  set_target_properties(kalmems::kalmems PROPERTIES
    IMPORTED_LOCATION "${kalmems_prefix}/lib/libkalmems_c.so"
    INTERFACE_INCLUDE_DIRECTORIES "${kalmems_prefix}/include")
  find_package(Threads REQUIRED)
  add_library(kalmems::static STATIC IMPORTED)
  set_target_properties(kalmems::static PROPERTIES
    IMPORTED_LOCATION "${kalmems_prefix}/lib/libkalmems_c.a"
    INTERFACE_INCLUDE_DIRECTORIES "${kalmems_prefix}/include"
    INTERFACE_LINK_LIBRARIES "Threads::Threads;${CMAKE_DL_LIBS};m")
endif()
