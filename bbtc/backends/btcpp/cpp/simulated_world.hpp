// A world that behaves as the domain says, by chance, to try the tree in. Made by bbtc; no need to edit it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <ostream>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <behaviortree_cpp/basic_types.h>

namespace ROBOT_TREE {

/// What is known of a fact. In this order, "and" is the minimum and "or" the maximum.
enum class Truth : std::uint8_t { False, Unknown, True };

using State = std::vector<Truth>;
using Test = std::function<Truth(const State&)>;

inline Truth all_of(std::initializer_list<Truth> parts) { return std::min(parts); }
inline Truth any_of(std::initializer_list<Truth> parts) { return std::max(parts); }
inline Truth truth(bool value) { return value ? Truth::True : Truth::False; }
inline Truth is_known(Truth part) { return truth(part != Truth::Unknown); }
inline Truth is_unknown(Truth part) { return truth(part == Truth::Unknown); }
inline Truth negated(Truth part) {
  return part == Truth::Unknown ? part : truth(part == Truth::False);
}

/// Facts, by number, that are set if a test is true in the state before the action (no test: always).
struct Effect {
  Test when;
  std::vector<std::pair<std::size_t, Truth>> changes;
};

struct Factor;

/// One thing that may happen: what it sets, and independent choices that follow. Its probability is its
/// weight over the sum of those it stands with.
struct Outcome {
  std::uint64_t weight;
  std::vector<Effect> effects;
  std::vector<Factor> then;
};

/// A choice between outcomes.
struct Factor {
  std::vector<Outcome> outcomes;
};

/// A whole number, kept as facts: its binary digits, the least first, which count from `low`.
struct Number {
  int low;
  std::vector<std::size_t> digits;
};

/// The facts, the states a run may start in, with their weights, and what each action does: one outcome of
/// every factor, independently.
struct Model {
  std::vector<std::string> facts;
  std::vector<std::pair<std::uint64_t, State>> initial;
  std::map<std::string, std::vector<Factor>> actions;
  std::map<std::string, Number> numbers = {};
};

/// The state of a run. Actions take some ticks; their outcome applies in the last one.
class SimulatedWorld {
 public:
  SimulatedWorld(const Model& model, std::uint64_t seed, unsigned ticks, std::ostream* report)
      : model_(model), random_(seed), ticks_(ticks), report_(report) {
    for (std::size_t index = 0; index < model_.facts.size(); ++index) {
      numbers_[model_.facts[index]] = index;
    }
    restart();
  }

  /// Begin a new run.
  void restart() {
    running_.clear();
    state_ = model_.initial[draw(model_.initial, [](const auto& state) { return state.first; })].second;
  }

  /// A fact; nothing where it is unknown.
  std::optional<bool> read(const std::string& fact) const {
    const Truth value = state_.at(numbers_.at(fact));
    return value == Truth::Unknown ? std::nullopt : std::optional<bool>(value == Truth::True);
  }

  /// The value of a number.
  int number(const std::string& name) const {
    const Number& number = model_.numbers.at(name);
    int value = number.low;
    for (std::size_t place = 0; place < number.digits.size(); ++place) {
      value += state_[number.digits[place]] == Truth::True ? 1 << place : 0;
    }
    return value;
  }

  /// Start or continue an action.
  BT::NodeStatus act(const std::string& action) {
    if (++running_[action] < ticks_) {
      return BT::NodeStatus::RUNNING;
    }
    running_.erase(action);
    std::map<std::size_t, Truth> changes;
    happen(model_.actions.at(action), changes);
    for (const auto& [fact, value] : changes) {
      state_[fact] = value;
    }
    report(action, changes);
    return BT::NodeStatus::SUCCESS;
  }

  /// The action is no longer wanted.
  void cancel(const std::string& action) { running_.erase(action); }

 private:
  template <typename Choices, typename Weight>
  std::size_t draw(const Choices& choices, Weight weight) {
    std::uint64_t total = 0;
    for (const auto& choice : choices) {
      total += weight(choice);
    }
    if (total == 0) {
      throw std::logic_error("nothing to choose from");
    }
    std::uint64_t point = std::uniform_int_distribution<std::uint64_t>(0, total - 1)(random_);
    std::size_t index = 0;
    while (point >= weight(choices[index])) {
      point -= weight(choices[index++]);
    }
    return index;
  }

  /// All tests read the state before the action; where changes clash, true wins over unknown, and unknown
  /// over false.
  void happen(const std::vector<Factor>& factors, std::map<std::size_t, Truth>& changes) {
    for (const auto& factor : factors) {
      const auto& outcomes = factor.outcomes;
      const auto& outcome = outcomes[draw(outcomes, [](const Outcome& one) { return one.weight; })];
      for (const auto& effect : outcome.effects) {
        if (!effect.when || effect.when(state_) == Truth::True) {
          for (const auto& [fact, value] : effect.changes) {
            const auto [place, is_new] = changes.try_emplace(fact, value);
            place->second = is_new ? value : std::max(value, place->second);
          }
        }
      }
      happen(outcome.then, changes);
    }
  }

  void report(const std::string& action, const std::map<std::size_t, Truth>& changes) {
    if (report_ == nullptr) {
      return;
    }
    *report_ << action << ':';
    auto facts = changes;
    for (const auto& [name, number] : model_.numbers) {
      bool changed = false;
      for (const auto digit : number.digits) {
        changed = facts.erase(digit) > 0 || changed;
      }
      if (changed) {
        *report_ << ' ' << name << " = " << this->number(name);
      }
    }
    for (const auto& [fact, value] : facts) {
      *report_ << ' ' << model_.facts[fact]
               << (value == Truth::True ? " true" : value == Truth::False ? " false" : " unknown");
    }
    *report_ << (changes.empty() ? " no change\n" : "\n");
  }

  const Model& model_;
  std::mt19937_64 random_;
  unsigned ticks_;
  std::ostream* report_;
  State state_;
  std::map<std::string, std::size_t> numbers_;
  std::map<std::string, unsigned> running_;
};

}  // namespace ROBOT_TREE
