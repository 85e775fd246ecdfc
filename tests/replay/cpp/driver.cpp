// Runs a tree in BehaviorTree.CPP for the tests, which play the world: every leaf asks on stdout what to
// return, and reads the answer from stdin.
//
//   driver PLUGIN FILE MAIN_TREE  KIND:ID:PORT,PORT…  KIND:ID:…      (KIND: condition or action)
//
// Asked:  C node id args…   a condition: 0, 1, 2 for failure, running, success
//         S node id args…   an action starts: 1, 2
//         G node            … goes on: 1, 2
//         H node            … is halted
//         T status          a tick has ended: 1 to tick again, h to be halted by a larger tree and asked
//                           again, 0 to begin a new run, q to quit
// An answer x ends the run: the next question is "T 3".
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <behaviortree_cpp/bt_factory.h>

namespace {

struct Stop : std::runtime_error {
  Stop() : std::runtime_error("the run is over") {}
};

bool stopped = false;
bool paused = false;

std::string ask(const std::string& question) {
  std::cout << question << std::endl;
  std::string answer;
  if (!std::getline(std::cin, answer)) {
    std::exit(0);
  }
  return answer;
}

BT::NodeStatus answered(const std::string& answer) {
  if (answer == "0") return BT::NodeStatus::FAILURE;
  if (answer == "1") return BT::NodeStatus::RUNNING;
  if (answer == "2") return BT::NodeStatus::SUCCESS;
  stopped = true;
  throw Stop();
}

std::string described(const BT::TreeNode& node, const std::vector<std::string>& ports) {
  std::ostringstream text;
  text << node.UID() << ' ' << node.registrationName();
  for (const auto& port : ports) {
    text << ' ' << node.getInput<std::string>(port).value_or("-");  // a bound need not be given
  }
  return text.str();
}

class Condition : public BT::ConditionNode {
 public:
  Condition(const std::string& name, const BT::NodeConfig& config, std::vector<std::string> ports)
      : BT::ConditionNode(name, config), ports_(std::move(ports)) {}
  BT::NodeStatus tick() override { return answered(ask("C " + described(*this, ports_))); }

 private:
  std::vector<std::string> ports_;
};

class Action : public BT::StatefulActionNode {
 public:
  Action(const std::string& name, const BT::NodeConfig& config, std::vector<std::string> ports)
      : BT::StatefulActionNode(name, config), ports_(std::move(ports)) {}
  BT::NodeStatus onStart() override { return answered(ask("S " + described(*this, ports_))); }
  BT::NodeStatus onRunning() override { return answered(ask("G " + std::to_string(UID()))); }
  void onHalted() override {
    if (!stopped) ask("H " + std::to_string(UID()));
  }

 private:
  std::vector<std::string> ports_;
};

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) {
    parts.push_back(part);
  }
  return parts;
}

template <typename Node>
void add(BT::BehaviorTreeFactory& factory, BT::NodeType type, const std::string& id,
         const std::vector<std::string>& ports) {
  BT::TreeNodeManifest manifest;
  manifest.type = type;
  manifest.registration_ID = id;
  for (const auto& port : ports) {
    manifest.ports.insert(BT::InputPort<std::string>(port));
  }
  factory.registerBuilder(manifest, [ports](const std::string& name, const BT::NodeConfig& config) {
    return std::make_unique<Node>(name, config, ports);
  });
}

}  // namespace

int main(int count, char** arguments) {
  const std::vector<std::string> given(arguments + 1, arguments + count);
  BT::BehaviorTreeFactory factory;
  factory.registerFromPlugin(given.at(0));
  for (std::size_t index = 3; index < given.size(); ++index) {
    const auto parts = split(given[index], ':');
    const auto ports = parts.size() > 2 ? split(parts[2], ',') : std::vector<std::string>();
    if (parts.at(0) == "condition") {
      add<Condition>(factory, BT::NodeType::CONDITION, parts.at(1), ports);
    } else {
      add<Action>(factory, BT::NodeType::ACTION, parts.at(1), ports);
    }
  }
  factory.registerBehaviorTreeFromFile(given.at(1));
  factory.registerSimpleCondition("DriverPaused", [](BT::TreeNode&) {
    return paused ? BT::NodeStatus::RUNNING : BT::NodeStatus::FAILURE;
  });
  factory.registerBehaviorTreeFromText(
      "<root BTCPP_format=\"4\"><BehaviorTree ID=\"DriverOuter\"><ReactiveFallback><DriverPaused/>"
      "<SubTree ID=\"" + given.at(2) + "\"/></ReactiveFallback></BehaviorTree></root>");
  while (true) {
    stopped = false;
    auto tree = factory.createTree("DriverOuter");
    for (std::string answer = "1"; answer == "1";) {
      int ended = 3;
      try {
        ended = tree.tickExactlyOnce() == BT::NodeStatus::SUCCESS   ? 2
                : tree.rootNode()->status() == BT::NodeStatus::RUNNING ? 1
                                                                       : 0;
      } catch (const std::exception& error) {
        if (!stopped) {
          std::cerr << error.what() << std::endl;
          return 1;
        }
      }
      answer = ask("T " + std::to_string(ended));
      if (answer == "h") {
        paused = true;
        tree.tickExactlyOnce();
        paused = false;
        answer = ask("T 1");
      }
      if (answer == "q") {
        return 0;
      }
    }
    stopped = true;  // what is still running is not halted in the world
  }
}
