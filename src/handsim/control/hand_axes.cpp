#include "handsim/control/hand_axes.h"

#include <algorithm>

#include "handsim/core/text.h"

namespace handsim::control {

namespace {

/// Adds the words between `_` and `.`.
void add_words(std::string_view name, std::vector<std::string>& out) {
  out.emplace_back();
  for (const char c : name)
    if (c == '_' || c == '.')
      out.emplace_back();
    else
      out.back() += c;
}

}  // namespace

bool is_misspelt(std::string_view name, const std::vector<std::string>& known,
                 const std::vector<std::string>& named) {
  std::vector<std::string> open = known, words, own;
  std::erase_if(open, [&](const std::string& each) { return std::ranges::find(named, each) != named.end(); });
  if (nearest_word(name, open)) return true;
  for (const std::string& each : known) add_words(each, words);
  add_words(name, own);
  // A word below 4 letters is misspelt only if its letters are in another order: dip and pip are two joints.
  return std::ranges::any_of(own, [&](const std::string& word) {
    if (std::ranges::find(words, word) != words.end()) return false;
    return (word.size() >= 4 && nearest_word(word, words)) ||
           std::ranges::any_of(words, [&](const std::string& each) {
             return std::is_permutation(each.begin(), each.end(), word.begin(), word.end());
           });
  });
}

bool matches(const HandAxis& axis, std::string_view name) {
  return name == "all" || name == axis.joint || name == axis.name();
}

bool HandAxes::accepts(std::string_view name) const {
  const auto is_absent = [&](const std::string& joint) {
    return name == joint || name.starts_with(joint + ".");
  };
  return std::ranges::any_of(axes, [&](const HandAxis& axis) { return matches(axis, name); }) ||
         std::ranges::any_of(absent, is_absent);
}

std::vector<std::string> HandAxes::joints() const {
  std::vector<std::string> out;
  for (const HandAxis& axis : axes)
    if (out.empty() || out.back() != axis.joint) out.push_back(axis.joint);
  out.insert(out.end(), absent.begin(), absent.end());
  return out;
}

HandAxes hand_axes(const model::Model& model, const model::HandIndex& hand, std::vector<std::string> absent) {
  HandAxes out;
  out.hand = hand.name;
  out.absent = std::move(absent);
  for (const int index : hand.joints) {
    const auto j = as_index(index);
    const model::Joint& joint = model.joints[j];
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      out.axes.push_back({joint.name.substr(hand.name.size() + 1), joint.axes[a].name, j, a,
                          as_index(joint.first_dof) + a, joint.axes[a].stop});
  }
  return out;
}

}  // namespace handsim::control
