# The package "bbtc" for CMake: trees as sources of a target.
#
#   find_package(bbtc REQUIRED)        # cmake -Dbbtc_DIR=$(bbtc --cmake-dir), unless it is found by itself
#
#   bbtc_add_tree(<target>
#     DOMAIN <file>
#     [PROBLEM <file>]                 # unless the domain's file holds it
#     [NAME <name>]                    # of the tree; default: the name of the problem's file
#     [SUCCESS <probability>]          # the target probability; default: the problem's own
#     [STRATEGY <strategy>]            # as `bbtc plan --strategy`
#     [EXPORTS <format>=<file> ...]    # default: btcpp=<name>.xml btcpp_palette=<name>_nodes.xml
#     [CPP]                            # the leaves and the interface of the robot, in C++, too
#     [NODES stock|bbtc]               # as `bbtc export --to btcpp -O nodes=...`
#     [NAMESPACE <name>]               # and -O namespace=...; with CPP, several trees of a program need it
#     [PLAN_OPTIONS <option> ...]      # more options of `bbtc plan`
#     [OUTPUT_DIRECTORY <directory>])  # default: the current binary directory
#
# Plans a tree and exports it, whenever the domain or the problem has changed, and adds the files to the
# sources of <target> (a library, an executable, or a custom target). The variable <target>_BBTC_FILES lists
# all that were made for the target so far, for install(FILES ...); not so what CPP makes: headers in a folder
# <name>, to be included as "<name>/leaves.hpp", "<name>/robot.hpp" and "<name>/robot_stub.hpp".

cmake_minimum_required(VERSION 3.20)

if(NOT DEFINED BBTC_EXECUTABLE)
  # First the program that stands beside this file in an environment, then that of the PATH.
  find_program(
    BBTC_EXECUTABLE
    NAMES bbtc
    HINTS "${CMAKE_CURRENT_LIST_DIR}/../../../bin" "${CMAKE_CURRENT_LIST_DIR}/../../../Scripts"
    DOC "The program bbtc")
endif()
if(NOT BBTC_EXECUTABLE)
  set(bbtc_FOUND FALSE)
  set(bbtc_NOT_FOUND_MESSAGE "the program bbtc was not found: set BBTC_EXECUTABLE, or the PATH")
  return()
endif()

function(bbtc_add_tree target)
  cmake_parse_arguments(
    PARSE_ARGV 1 arg "CPP" "DOMAIN;PROBLEM;NAME;SUCCESS;STRATEGY;NODES;NAMESPACE;OUTPUT_DIRECTORY"
    "EXPORTS;PLAN_OPTIONS")
  if(NOT TARGET "${target}")
    message(FATAL_ERROR "bbtc_add_tree: there is no target '${target}'")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "bbtc_add_tree: unknown arguments: ${arg_UNPARSED_ARGUMENTS}")
  endif()
  if(NOT arg_DOMAIN)
    message(FATAL_ERROR "bbtc_add_tree: DOMAIN is missing")
  endif()

  # Lists of CMake, and the makefiles that it writes, take such names for several, or for something else.
  foreach(name IN ITEMS DOMAIN PROBLEM NAME OUTPUT_DIRECTORY)
    if("${arg_${name}}" MATCHES "[;#%\n\"]|..:|:[^/\\]")
      message(FATAL_ERROR "bbtc_add_tree: ${name} has a character that CMake cannot pass on: ${arg_${name}}")
    endif()
  endforeach()

  set(inputs)
  foreach(input IN ITEMS "${arg_DOMAIN}" "${arg_PROBLEM}")
    if(NOT input STREQUAL "")
      get_filename_component(input "${input}" ABSOLUTE)
      list(APPEND inputs "${input}")
    endif()
  endforeach()
  if(NOT arg_NAME)
    list(GET inputs -1 last)
    get_filename_component(arg_NAME "${last}" NAME_WE)
  endif()
  if(NOT arg_OUTPUT_DIRECTORY)
    set(arg_OUTPUT_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}")
  endif()
  get_filename_component(directory "${arg_OUTPUT_DIRECTORY}" ABSOLUTE BASE_DIR "${CMAKE_CURRENT_BINARY_DIR}")
  file(MAKE_DIRECTORY "${directory}")
  if(NOT arg_EXPORTS)
    set(arg_EXPORTS "btcpp=${arg_NAME}.xml" "btcpp_palette=${arg_NAME}_nodes.xml")
  endif()

  set(options ${arg_PLAN_OPTIONS})
  if(NOT "${arg_SUCCESS}" STREQUAL "")
    list(APPEND options --target "${arg_SUCCESS}")
  endif()
  if(arg_STRATEGY)
    list(APPEND options --strategy "${arg_STRATEGY}")
  endif()

  # bbtc leaves a file untouched that would not change. Make wants it to be newer than what it was made
  # from all the same: hence the touch.
  set(tree "${directory}/${arg_NAME}.tree.json")
  add_custom_command(
    OUTPUT "${tree}"
    COMMAND "${BBTC_EXECUTABLE}" plan ${inputs} ${options} --quiet -o "${tree}"
    COMMAND "${CMAKE_COMMAND}" -E touch "${tree}"
    DEPENDS ${inputs} "${BBTC_EXECUTABLE}"
    COMMENT "Planning ${arg_NAME}"
    VERBATIM)

  set(btcpp_options)
  if(arg_NODES)
    list(APPEND btcpp_options -O "nodes=${arg_NODES}")
  endif()
  if(arg_NAMESPACE)
    list(APPEND btcpp_options -O "namespace=${arg_NAMESPACE}")
  endif()

  set(files "${tree}")
  foreach(export IN LISTS arg_EXPORTS)
    if(NOT export MATCHES "^([^=]+)=(.+)$")
      message(FATAL_ERROR "bbtc_add_tree: '${export}' is not <format>=<file>")
    endif()
    set(format "${CMAKE_MATCH_1}")
    get_filename_component(file "${CMAKE_MATCH_2}" ABSOLUTE BASE_DIR "${directory}")
    get_filename_component(parent "${file}" DIRECTORY)
    file(MAKE_DIRECTORY "${parent}")
    set(options)
    if(format MATCHES "^btcpp")
      set(options ${btcpp_options})
    endif()
    add_custom_command(
      OUTPUT "${file}"
      COMMAND "${BBTC_EXECUTABLE}" export "${tree}" --to "${format}" ${options} -o "${file}"
      COMMAND "${CMAKE_COMMAND}" -E touch "${file}"
      DEPENDS "${tree}"
      COMMENT "Exporting ${arg_NAME} to ${format}"
      VERBATIM)
    list(APPEND files "${file}")
  endforeach()

  set(sources ${files})
  get_target_property(type "${target}" TYPE)
  if(arg_CPP)
    if(type STREQUAL "UTILITY")
      message(FATAL_ERROR "bbtc_add_tree: CPP is for a library or an executable, which '${target}' is not")
    endif()
    set(headers robot.hpp robot_stub.hpp leaves.hpp simulated_robot.hpp simulated_world.hpp)
    if(arg_NODES STREQUAL "bbtc")
      list(APPEND headers bbtc_nodes.hpp)
    endif()
    list(TRANSFORM headers PREPEND "${directory}/${arg_NAME}/")
    # The stamp tells what was made from what. Headers that stay as they are keep their times: what includes
    # them is not compiled again.
    set(stamp "${directory}/${arg_NAME}.cpp.stamp")
    add_custom_command(
      OUTPUT "${stamp}"
      BYPRODUCTS ${headers}
      COMMAND "${BBTC_EXECUTABLE}" export "${tree}" --to btcpp_project ${btcpp_options} -o
              "${directory}/${arg_NAME}"
      COMMAND "${CMAKE_COMMAND}" -E touch "${stamp}"
      DEPENDS "${tree}"
      COMMENT "Exporting ${arg_NAME} to C++"
      VERBATIM)
    list(APPEND sources "${stamp}" ${headers})
    target_include_directories("${target}" PRIVATE "${directory}")
  endif()

  target_sources("${target}" PRIVATE ${sources})
  if(type STREQUAL "UTILITY")
    # Sources of a custom target are not made for it by themselves.
    string(MAKE_C_IDENTIFIER "${target}_${arg_NAME}" id)
    add_custom_target("${id}_bbtc" DEPENDS ${files})
    add_dependencies("${target}" "${id}_bbtc")
  endif()
  set(all ${${target}_BBTC_FILES} ${files})
  set("${target}_BBTC_FILES" ${all} PARENT_SCOPE)
endfunction()
