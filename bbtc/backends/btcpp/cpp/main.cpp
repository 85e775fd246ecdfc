// Runs the tree on your robot: copy robot_stub.hpp to my_robot.hpp, and fill it in.
#include <chrono>
#include <cstdlib>
#include <iostream>

#include "leaves.hpp"

#if defined(HAS_MY_ROBOT) || __has_include("my_robot.hpp")
#include "my_robot.hpp"
#else
#include "robot_stub.hpp"
#endif

int main() {
  try {
    ROBOT_TREE::MyRobot robot;
    BT::BehaviorTreeFactory factory;
    ROBOT_TREE::registerLeaves(factory, robot);
    factory.registerBehaviorTreeFromFile(TREE_FILE);
    // A tree runs once: its latches stay latched. Make a new one for another run.
    auto tree = factory.createTree(ROBOT_TREE::kMainTree);
    const BT::NodeStatus status = ROBOT_TREE::run(tree, std::chrono::milliseconds(100));
    if (status == BT::NodeStatus::RUNNING) {
      std::cout << "Interrupted.\n";
      return EXIT_FAILURE;
    }
    std::cout << "The tree returned " << BT::toStr(status) << ".\n";
    return EXIT_SUCCESS;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
