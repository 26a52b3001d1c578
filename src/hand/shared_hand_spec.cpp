#include <deque>
#include <memory>
#include <mutex>
#include <utility>

#include "handsim/hand/hand_spec.h"

namespace handsim::hand {

namespace {

/// A tree that was read without a problem or warning.
struct Known {
  std::optional<YamlNode> given;  ///< absent where reading it has read files, which may change
  YamlNode read;                  ///< the same with defaults
  std::shared_ptr<const HandSpec> spec;
};

/// The last hand models that this process has read.
class KnownSpecs {
 public:
  std::vector<std::shared_ptr<const Known>> all() {
    const std::lock_guard lock(mutex_);
    return {known_.begin(), known_.end()};
  }
  void add(Known known) {
    constexpr std::size_t kMost = 8;
    const std::lock_guard lock(mutex_);
    known_.push_front(std::make_shared<const Known>(std::move(known)));
    if (known_.size() > kMost) known_.pop_back();
  }

 private:
  std::mutex mutex_;
  std::deque<std::shared_ptr<const Known>> known_;
};

KnownSpecs& known_specs() {
  static KnownSpecs specs;
  return specs;
}

}  // namespace

std::shared_ptr<const HandSpec> shared_hand_spec(YamlNode& node, const std::string& path,
                                                 Diagnostics& diagnostics) {
  const auto read_it = [&] {
    return std::make_shared<const HandSpec>(read_hand_spec(node, path, diagnostics));
  };
  if (diagnostics.recorder) return read_it();
  for (const auto& known : known_specs().all())
    if (node.same_as(known->read) || (known->given && node.same_as(*known->given))) {
      node = known->read;
      return known->spec;
    }
  Known fresh;
  fresh.given = node;
  const std::size_t problems = diagnostics.problems.size(), warnings = diagnostics.warnings.size();
  const std::size_t budget = diagnostics.budget.left;
  fresh.spec = read_it();
  if (diagnostics.problems.size() != problems || diagnostics.warnings.size() != warnings) return fresh.spec;
  if (diagnostics.budget.left != budget) fresh.given.reset();
  // Hands of one scene that name the same file have one model.
  for (const auto& known : known_specs().all())
    if (node.same_as(known->read)) {
      node = known->read;
      fresh.spec = known->spec;
      break;
    }
  fresh.read = node;
  auto spec = fresh.spec;
  known_specs().add(std::move(fresh));
  return spec;
}

}  // namespace handsim::hand
