// A simulated world with hidden facts, whose robot is told no more than it could be. Made by bbtc; no need to
// edit it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "monitor.hpp"
#include "simulated_world.hpp"

namespace ROBOT_TREE {

/// An observation: its name, how often it is right and wrong, what it tells of, and when it is made (no test:
/// always).
struct Telling {
  std::string name;
  std::uint64_t right;
  std::uint64_t wrong;
  Test tells;
  Test when;
};

/// Facts, by number, that are drawn together.
struct Draw {
  std::uint64_t weight;
  std::vector<std::pair<std::size_t, Truth>> facts;
};

/// How likely the fact at a place of a walk is false and true, and the turns that come next if it is (-1: none).
struct Turn {
  std::size_t place;
  std::array<std::uint64_t, 2> weights;
  std::array<int, 2> next;
};

/// Facts, by number, that are drawn one after the other; the last turn comes first. Facts that no turn draws are
/// as likely true as false.
struct Walk {
  std::vector<std::size_t> facts;
  std::vector<Turn> turns;
};

/// What may be true at the start: independent choices, and walks; and what each action tells.
struct HiddenModel {
  std::vector<std::vector<Draw>> priors;
  std::map<std::string, std::vector<Telling>> tellings;
  std::vector<Walk> walks;
};

/// The state of a run: what is true, and, told by the monitor, what is known.
class HiddenWorld : public SimulatedWorld {
 public:
  HiddenWorld(const Model& model, const HiddenModel& hidden, Monitor& monitor, std::uint64_t seed,
              unsigned ticks, std::ostream* report)
      : SimulatedWorld(model, seed, ticks, report), hidden_(hidden), monitor_(monitor) {
    begin(nullptr);
  }

  /// Begin a new run.
  void restart() {
    SimulatedWorld::restart();
    begin(report_);
  }

  /// Start or continue an action.
  BT::NodeStatus act(const std::string& action) {
    const BT::NodeStatus status = SimulatedWorld::act(action);
    if (status != BT::NodeStatus::RUNNING) {
      listen(action);
    }
    return status;
  }

 private:
  void begin(std::ostream* report) {
    for (const auto& prior : hidden_.priors) {
      const auto& drawn = prior[draw(prior, [](const Draw& one) { return one.weight; })];
      for (const auto& [fact, value] : drawn.facts) {
        state_[fact] = value;
      }
      if (report != nullptr) {
        *report << "the truth:";
        for (const auto& [fact, value] : drawn.facts) {
          *report << (value == Truth::True ? " " + model_.facts[fact] : "");
        }
        *report << '\n';
      }
    }
    for (const auto& walk : hidden_.walks) {
      go(walk, report);
    }
    monitor_.restart();
    listen("");
  }

  void go(const Walk& walk, std::ostream* report) {
    static const Turn none = {0, {1u, 1u}, {-1, -1}};
    int at = static_cast<int>(walk.turns.size()) - 1;
    for (std::size_t place = 0; place < walk.facts.size(); ++place) {
      const bool asked = at >= 0 && walk.turns[at].place == place;
      const auto& turn = asked ? walk.turns[at] : none;
      const auto value = draw(turn.weights, [](std::uint64_t weight) { return weight; });
      state_[walk.facts[place]] = truth(value == 1);
      at = asked ? turn.next[value] : at;
    }
    if (report != nullptr) {
      *report << "the truth:";
      for (const auto fact : walk.facts) {
        *report << (state_[fact] == Truth::True ? " " + model_.facts[fact] : "");
      }
      *report << '\n';
    }
  }

  void listen(const std::string& action) {
    if (monitor_.listens(action)) {
      Readings readings;
      const auto tellings = hidden_.tellings.find(action);
      if (tellings != hidden_.tellings.end()) {
        for (const auto& telling : tellings->second) {
          if (!telling.when || telling.when(state_) == Truth::True) {
            const std::vector<std::uint64_t> weights = {telling.right, telling.wrong};
            const bool right = draw(weights, [](std::uint64_t weight) { return weight; }) == 0;
            readings[telling.name] = (telling.tells(state_) == Truth::True) == right;
          }
        }
      }
      monitor_.told(action, readings);
      report(readings);
    }
    for (const auto& fact : monitor_.facts()) {
      const auto number = numbers_.find(fact);
      if (number != numbers_.end()) {
        const auto value = monitor_.value(fact);
        state_[number->second] = !value ? Truth::Unknown : truth(*value);
      }
    }
  }

  void report(const Readings& readings) {
    if (report_ == nullptr) {
      return;
    }
    *report_ << "  told:";
    for (const auto& [name, value] : readings) {
      *report_ << ' ' << name << (value ? " true" : " false");
    }
    *report_ << "; known:";
    for (const auto& fact : monitor_.facts()) {
      if (const auto value = monitor_.value(fact)) {
        *report_ << ' ' << (*value ? "" : "not ") << fact;
      }
    }
    *report_ << ' ' << monitor_.outside() << '\n';
  }

  const HiddenModel& hidden_;
  Monitor& monitor_;
};

}  // namespace ROBOT_TREE
