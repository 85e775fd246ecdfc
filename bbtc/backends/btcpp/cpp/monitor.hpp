// What a robot works out of its readings where facts are hidden. Made by bbtc; no need to edit it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ROBOT_TREE {

/// What each observation that was made told, by name: whether it seemed true. Facts that the robot sees may
/// stand here, too, by name, where they have changed: else they are read.
using Readings = std::map<std::string, bool>;

/// What an action may tell. The rows lead from what was believed, the seen facts before the action, the
/// readings, and the seen facts after it, to what is believed then. Of what is seen and told, 0 stands for
/// false, 1 for true, 2 for unknown, or an observation that was not made.
struct Move {
  std::vector<std::string> seen;
  std::vector<std::string> readings;
  std::map<std::vector<int>, int> rows;
};

/// Facts that depend on each other: what is known of them in each belief, by number, the belief to begin
/// with, and what each action may tell of them.
struct Part {
  std::vector<std::string> facts;
  std::vector<std::vector<int>> values;
  int start;
  std::map<std::string, Move> moves;
};

/// Knows of hidden facts what follows from all that the robot was told. `told` is to be called for every
/// action that tells anything, in the moment in which its effects are seen. What cannot be in the model ends
/// that: `outside` says what it was, and nothing is known from then on.
class Monitor {
 public:
  using See = std::function<std::optional<bool>(const std::string& fact)>;

  /// `see` tells what the robot sees of a fact that is not hidden.
  Monitor(const std::vector<Part>& parts, See see) : parts_(parts), see_(std::move(see)) {
    for (std::size_t number = 0; number < parts_.size(); ++number) {
      const auto& facts = parts_[number].facts;
      for (std::size_t at = 0; at < facts.size(); ++at) {
        places_[facts[at]] = {number, at};
      }
    }
    restart();
  }

  /// Forget all that was told.
  void restart() {
    outside_.clear();
    before_.clear();
    beliefs_.clear();
    for (const auto& part : parts_) {
      beliefs_.push_back(part.start);
    }
    waits_ = listens("");
  }

  /// What was outside the model; empty if nothing was.
  const std::string& outside() const { return outside_; }

  /// Is what the robot is told before its first action still missing?
  bool waits() const { return waits_; }

  /// Does the action tell anything? The empty name stands for what is told before the first one.
  bool listens(const std::string& action) const {
    return std::any_of(parts_.begin(), parts_.end(),
                       [&](const Part& part) { return part.moves.count(action) != 0; });
  }

  /// Is this a fact that it tells?
  bool knows(const std::string& fact) const { return places_.count(fact) != 0; }

  /// What is known of a hidden fact; nothing where it is unknown.
  std::optional<bool> value(const std::string& fact) const {
    const auto place = places_.find(fact);
    if (place == places_.end() || !outside_.empty()) {
      return std::nullopt;
    }
    const auto [number, at] = place->second;
    const int value = parts_[number].values[static_cast<std::size_t>(beliefs_[number])][at];
    return value == kUnknown ? std::nullopt : std::optional<bool>(value == 1);
  }

  /// Every fact that it tells.
  std::vector<std::string> facts() const {
    std::vector<std::string> all;
    for (const auto& [fact, place] : places_) {
      all.push_back(fact);
    }
    return all;
  }

  /// Every fact that it asks `see` for.
  std::set<std::string> asks() const {
    std::set<std::string> all;
    for (const auto& part : parts_) {
      for (const auto& [action, move] : part.moves) {
        all.insert(move.seen.begin(), move.seen.end());
      }
    }
    return all;
  }

  /// The action starts. The tree calls this.
  void begin(const std::string& action) {
    if (!listens(action)) {
      return;
    }
    for (const auto& [earlier, seen] : before_) {
      leave(earlier + " told nothing");
    }
    auto& before = before_[action];
    before.clear();
    for (const auto& part : parts_) {
      const auto move = part.moves.find(action);
      before.push_back(move == part.moves.end() ? std::vector<int>() : look(move->second, {}));
    }
  }

  /// What the action told; the empty name stands for what the robot is told before its first one.
  void told(const std::string& action, const Readings& readings = {}) {
    if (!listens(action)) {
      return;
    }
    const std::string name = action.empty() ? "what is told at the start" : action;
    const auto found = before_.find(action);
    const bool first = action.empty() && waits_;
    if (found == before_.end() && !first) {
      leave(name + ": it was not started");
      return;
    }
    const auto before = first ? std::vector<std::vector<int>>() : found->second;
    if (first) {
      waits_ = false;
    } else {
      before_.erase(found);
    }
    std::set<std::string> used;
    for (std::size_t number = 0; number < parts_.size(); ++number) {
      const auto place = parts_[number].moves.find(action);
      if (place == parts_[number].moves.end()) {
        continue;
      }
      const Move& move = place->second;
      const std::vector<int> after = look(move, readings);
      used.insert(move.readings.begin(), move.readings.end());
      used.insert(move.seen.begin(), move.seen.end());
      std::vector<int> key = {beliefs_[number]};
      const auto& seen = first ? after : before[number];  // nothing has changed before the first
      key.insert(key.end(), seen.begin(), seen.end());
      for (const auto& reading : move.readings) {
        const auto one = readings.find(reading);
        key.push_back(one == readings.end() ? kUnknown : one->second ? 1 : 0);
      }
      key.insert(key.end(), after.begin(), after.end());
      const auto row = move.rows.find(key);
      if (row == move.rows.end()) {
        leave(name + ":" + words(move, key, seen.size()));
      } else {
        beliefs_[number] = row->second;
      }
    }
    for (const auto& [reading, value] : readings) {
      if (used.count(reading) == 0) {
        leave(name + ": it has no reading " + reading);
      }
    }
  }

 private:
  static constexpr int kUnknown = 2;

  std::vector<int> look(const Move& move, const Readings& readings) const {
    std::vector<int> values;
    for (const auto& fact : move.seen) {
      const auto one = readings.find(fact);
      const auto value = one == readings.end() ? see_(fact) : std::optional<bool>(one->second);
      values.push_back(!value ? kUnknown : *value ? 1 : 0);
    }
    return values;
  }

  static std::string words(const Move& move, const std::vector<int>& key, std::size_t seen) {
    std::string text;
    std::size_t at = 1 + seen;
    for (const auto* names : {&move.readings, &move.seen}) {
      for (const auto& name : *names) {
        const int value = key[at++];
        text += " " + name + (value == kUnknown ? " unknown" : value == 1 ? " true" : " false");
      }
    }
    return text.empty() ? " at this point" : text;
  }

  void leave(const std::string& why) {
    if (outside_.empty()) {
      outside_ = "outside the model: " + why;
    }
  }

  const std::vector<Part>& parts_;
  See see_;
  std::vector<int> beliefs_;
  std::map<std::string, std::pair<std::size_t, std::size_t>> places_;
  std::map<std::string, std::vector<std::vector<int>>> before_;
  std::string outside_;
  bool waits_ = false;
};

}  // namespace ROBOT_TREE
