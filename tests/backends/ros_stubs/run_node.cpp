// Runs the generated node, with the arguments before --ros-args. Each one after that tells what is published before a
// spin: "" for nothing, or the beliefs of a message, such as "Seen|soda=1;IsLit=2" (a condition, its arguments, its
// value). After the last one it is interrupted, but "for ever" is never over.
#include <csignal>
#include <sstream>

#define main run_generated_node
#include "main.cpp"
#undef main

namespace {
using Message = robot_tree::Beliefs::Message;

Message parsed(const std::string& text) {
  Message message;
  std::istringstream beliefs(text);
  for (std::string one; std::getline(beliefs, one, ';');) {
    const auto equals = one.rfind('=');
    std::istringstream words(one.substr(0, equals));
    robot_tree::Beliefs::Belief belief;
    std::getline(words, belief.condition, '|');
    for (std::string word; std::getline(words, word, '|');) {
      belief.arguments.push_back(word);
    }
    belief.value = static_cast<std::uint8_t>(std::stoi(one.substr(equals + 1)));
    message.beliefs.push_back(belief);
  }
  return message;
}
}  // namespace

int main(int count, char** arguments) {
  int next = 1;
  while (next < count && std::string(arguments[next]) != "--ros-args") {
    ++next;
  }
  ++next;
  rclcpp::onSpin() = [&] {
    if (next < count && std::string(arguments[next]) == "for ever") {
      return;
    }
    if (next >= count) {
      std::raise(SIGTERM);
    } else if (const std::string text = arguments[next++]; !text.empty()) {
      std::printf("publish %s\n", text.c_str());
      rclcpp::Node::latest()->publish("beliefs", parsed(text == "nothing" ? "" : text));
    }
  };
  return run_generated_node(count, arguments);
}
