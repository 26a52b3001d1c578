// What readers take beside what a tree says: defaults of keys that it lacks, and values in the place of its
// own, such as the content of a file that it names. Reading changes no tree; the resolved text is that of a
// copy with all of this.
#pragma once

#include <cstddef>
#include <deque>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/yaml.h"

namespace handsim {

class Resolution {
 public:
  /// A value for the key at this dotted path, if the tree lacks it. @returns it; valid as long as this object
  const YamlNode& fill(std::string path, YamlNode value) {
    return entries_.emplace_back(Entry{std::move(path), std::move(value), true}).value;
  }
  /// A value in the place of the one at this path. @returns it, likewise
  const YamlNode& replace(std::string path, YamlNode value) {
    return entries_.emplace_back(Entry{std::move(path), std::move(value), false}).value;
  }

  /// Number of values so far.
  std::size_t size() const { return entries_.size(); }
  /// A tree with the values for it. @param path of the tree  @param first value that counts
  YamlNode applied(YamlNode tree, std::string_view path = {}, std::size_t first = 0) const;

  std::vector<std::filesystem::path> files;  ///< that values name, and that are not YAML

 private:
  struct Entry {
    std::string path;
    YamlNode value;
    bool fills;  ///< only where the tree has nothing
  };

  std::deque<Entry> entries_;
};

}  // namespace handsim
