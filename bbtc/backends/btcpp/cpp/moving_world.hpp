// A simulated world in which things happen by themselves. Made by bbtc; no need to edit it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "simulated_world.hpp"

namespace ROBOT_TREE {

/// An event: where it may happen (no test: anywhere), and what it does.
struct Event {
  Test when;
  std::vector<Factor> factors;
};

/// While what an action goes on that events may end, and what happens else.
struct Interruption {
  Test goes_on;
  std::vector<Factor> abort;
};

/// Events, round by round.
using Rounds = std::vector<std::vector<Event>>;

/// The events of each action, and the actions that they may end.
struct Moves {
  std::map<std::string, Rounds> events;
  std::map<std::string, Interruption> interrupted;
};

/// The state of a run. Events happen after each action, or, where they may end it, before its outcome.
class MovingWorld : public SimulatedWorld {
 public:
  MovingWorld(const Model& model, const Moves& moves, std::uint64_t seed, unsigned ticks, std::ostream* report)
      : SimulatedWorld(model, seed, ticks, report), moves_(moves) {}

  /// Start or continue an action.
  BT::NodeStatus act(const std::string& action) {
    const auto interruption = moves_.interrupted.find(action);
    if (interruption == moves_.interrupted.end()) {
      const BT::NodeStatus status = SimulatedWorld::act(action);
      if (status != BT::NodeStatus::RUNNING) {
        move(action);
      }
      return status;
    }
    if (running_[action] + 1 < ticks_) {
      return SimulatedWorld::act(action);
    }
    move(action);
    if (interruption->second.goes_on(state_) == Truth::True) {
      return SimulatedWorld::act(action);
    }
    running_.erase(action);
    std::map<std::size_t, Truth> changes;
    happen(interruption->second.abort, changes);
    apply(changes);
    report(action + " aborted", changes);
    return BT::NodeStatus::SUCCESS;
  }

 private:
  /// The events of one draw: those of a round all read the state that it begins with.
  void move(const std::string& action) {
    for (const auto& events : moves_.events.at(action)) {
      std::map<std::size_t, Truth> changes;
      for (const auto& event : events) {
        if (!event.when || event.when(state_) == Truth::True) {
          happen(event.factors, changes);
        }
      }
      std::map<std::size_t, Truth> fresh;
      for (const auto& [fact, value] : changes) {
        if (state_[fact] != value) {
          fresh.emplace(fact, value);
        }
      }
      apply(changes);
      if (!fresh.empty()) {
        report("by itself", fresh);
      }
    }
  }

  void apply(const std::map<std::size_t, Truth>& changes) {
    for (const auto& [fact, value] : changes) {
      state_[fact] = value;
    }
  }

  const Moves& moves_;
};

}  // namespace ROBOT_TREE
