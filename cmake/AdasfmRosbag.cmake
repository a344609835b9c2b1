# SPDX-License-Identifier: BSD-3-Clause

# ROS 1 bags through Debian's librosbag-storage. Sets ADASFM_HAS_ROSBAG and what
# a target needs to use it.
set(ADASFM_WITH_ROSBAG AUTO CACHE STRING
    "Read ROS 1 bags: ON, OFF or AUTO (when librosbag-storage is installed)")
set_property(CACHE ADASFM_WITH_ROSBAG PROPERTY STRINGS AUTO ON OFF)

# By files: the packages' own CMake configurations want a ROS workspace. bag.h
# includes pluginlib, which lies in folders of its own.
set(ADASFM_HAS_ROSBAG FALSE)
if(ADASFM_WITH_ROSBAG)
  set(ADASFM_HAS_ROSBAG TRUE)
  foreach(header rosbag/bag.h sensor_msgs/Imu.h nav_msgs/Odometry.h
          pluginlib/class_loader.hpp class_loader/class_loader.hpp
          rcutils/allocator.h rcpputils/shared_library.hpp
          ament_index_cpp/get_resource.hpp)
    get_filename_component(folder ${header} DIRECTORY)
    string(MAKE_C_IDENTIFIER ADASFM_ROSBAG_${header} variable)
    find_path(${variable} ${header} PATH_SUFFIXES ${folder})
    mark_as_advanced(${variable})
    list(APPEND ADASFM_ROSBAG_INCLUDE_DIRS ${${variable}})
    if(NOT ${variable})
      set(ADASFM_HAS_ROSBAG FALSE)
    endif()
  endforeach()
  list(REMOVE_DUPLICATES ADASFM_ROSBAG_INCLUDE_DIRS)
  foreach(library rosbag_storage roscpp_serialization rostime cpp_common
          class_loader console_bridge)
    find_library(ADASFM_ROSBAG_${library} ${library})
    mark_as_advanced(ADASFM_ROSBAG_${library})
    list(APPEND ADASFM_ROSBAG_LIBRARIES ${ADASFM_ROSBAG_${library}})
    if(NOT ADASFM_ROSBAG_${library})
      set(ADASFM_HAS_ROSBAG FALSE)
    endif()
  endforeach()
endif()
if(ADASFM_WITH_ROSBAG STREQUAL "ON" AND NOT ADASFM_HAS_ROSBAG)
  message(FATAL_ERROR "ADASFM_WITH_ROSBAG is ON, but librosbag-storage-dev, "
          "libsensor-msgs-dev or libnav-msgs-dev is not installed")
endif()
message(STATUS "ROS bags: ${ADASFM_HAS_ROSBAG}")

# Lets a target read or write bags where that is possible.
function(adasfm_use_rosbag target)
  if(ADASFM_HAS_ROSBAG)
    target_compile_definitions(${target} PRIVATE ADASFM_HAS_ROSBAG)
    target_include_directories(${target} SYSTEM PRIVATE
                               ${ADASFM_ROSBAG_INCLUDE_DIRS})
    target_link_libraries(${target} PRIVATE ${ADASFM_ROSBAG_LIBRARIES})
  endif()
endfunction()
