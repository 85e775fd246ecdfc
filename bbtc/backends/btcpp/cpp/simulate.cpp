// Runs the tree in the simulated world. Made by bbtc; no need to edit it.
//   simulate [--seed N] [--runs N] [--ticks N] [--tree FILE]
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <stdexcept>
#include <string>

#include "leaves.hpp"
#include "simulated_robot.hpp"

namespace {

constexpr int kMostTicks = 1000000;

struct Options {
  std::uint64_t seed = 0;
  unsigned runs = 1;
  unsigned ticks = 1;
  std::string tree = TREE_FILE;
};

Options parse(int count, char** arguments) {
  Options options;
  for (int index = 1; index < count; index += 2) {
    const std::string name = arguments[index];
    if (index + 1 == count) {
      throw std::invalid_argument(name + " needs a value");
    }
    const std::string value = arguments[index + 1];
    if (name == "--seed") {
      options.seed = std::stoull(value);
    } else if (name == "--runs") {
      options.runs = static_cast<unsigned>(std::stoul(value));
    } else if (name == "--ticks") {
      options.ticks = static_cast<unsigned>(std::stoul(value));
    } else if (name == "--tree") {
      options.tree = value;
    } else {
      throw std::invalid_argument("unknown option " + name);
    }
  }
  return options;
}

BT::NodeStatus run(BT::Tree tree) {
  for (int tick = 0; tick < kMostTicks; ++tick) {
    const BT::NodeStatus status = tree.tickExactlyOnce();
    if (status != BT::NodeStatus::RUNNING) {
      return status;
    }
  }
  return BT::NodeStatus::RUNNING;
}

}  // namespace

int main(int count, char** arguments) {
  try {
    const Options options = parse(count, arguments);
    ROBOT_TREE::SimulatedRobot robot(options.seed, options.ticks, options.runs == 1 ? &std::cout : nullptr);
    BT::BehaviorTreeFactory factory;
    ROBOT_TREE::registerLeaves(factory, robot);
    factory.registerBehaviorTreeFromFile(std::filesystem::absolute(options.tree));
    unsigned successes = 0;
    for (unsigned number = 0; number < options.runs; ++number) {
      robot.world().restart();
      // A tree runs once: its latches stay latched.
      const BT::NodeStatus status = run(factory.createTree(ROBOT_TREE::kMainTree));
      successes += status == BT::NodeStatus::SUCCESS ? 1 : 0;
      if (options.runs == 1) {
        std::cout << "The tree returned " << BT::toStr(status) << ".\n";
      }
    }
    if (options.runs != 1) {
      std::cout << successes << " of " << options.runs << " runs succeeded.\n";
    }
    return EXIT_SUCCESS;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
