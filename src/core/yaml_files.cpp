// YAML files, parsed once: a study loads the same hand model and controller thousands of times.
#include <deque>
#include <memory>
#include <mutex>

#include "handsim/core/input_file.h"
#include "handsim/core/yaml.h"

namespace handsim {

namespace {

struct Parsed {
  std::string name, text;
  YamlNode tree;
  std::size_t spent = 0;  ///< of the budget
};

/// The last files that this process has parsed. Read again each time: the text tells whether it is known.
class KnownFiles {
 public:
  std::shared_ptr<const Parsed> find(const std::string& name, const std::string& text) {
    const std::lock_guard lock(mutex_);
    for (const auto& each : known_)
      if (each->name == name && each->text == text) return each;
    return nullptr;
  }
  void add(Parsed parsed) {
    constexpr std::size_t kMost = 16, kLongest = 1U << 18U;
    if (parsed.text.size() > kLongest || parsed.spent > 32 * kLongest) return;
    const std::lock_guard lock(mutex_);
    // An earlier text of the file is of no more use.
    std::erase_if(known_, [&](const auto& each) { return each->name == parsed.name; });
    known_.push_front(std::make_shared<const Parsed>(std::move(parsed)));
    if (known_.size() > kMost) known_.pop_back();
  }

 private:
  std::mutex mutex_;
  std::deque<std::shared_ptr<const Parsed>> known_;
};

KnownFiles& known_files() {
  static KnownFiles files;
  return files;
}

}  // namespace

YamlNode load_yaml(const std::filesystem::path& path, YamlBudget& budget) {
  std::string text = read_input_file(path, "a readable YAML file", kYamlMaxBytes);
  const std::string name = path.string();
  const auto known = known_files().find(name, text);
  if (known && known->spent <= budget.left) {
    budget.left -= known->spent;
    return known->tree;
  }
  const std::size_t left = budget.left;
  YamlNode tree = parse_yaml(text, name, budget);
  known_files().add({name, std::move(text), tree, left - budget.left});
  return tree;
}

YamlNode load_yaml(const std::filesystem::path& path) {
  YamlBudget budget;
  return load_yaml(path, budget);
}

}  // namespace handsim
