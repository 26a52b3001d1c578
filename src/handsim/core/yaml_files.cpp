#include "handsim/core/yaml_files.h"

#include <algorithm>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/data_folder.h"
#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"

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

std::filesystem::path path_beside(const YamlNode& node) {
  return (std::filesystem::path(node.place().file).parent_path() / node.text).lexically_normal();
}

/// The names of a folder for a message: those in folders below it only if they are near.
std::string shipped_hint(const YamlNode& node, std::string_view folder) {
  constexpr std::size_t kMost = 30;
  const std::vector<std::string> names = shipped_names(folder);
  const std::string got = std::filesystem::path(node.text).stem().string();
  const std::string near = nearest_hint(got, names);
  if (!near.empty() || names.empty() || names.size() > kMost) return near;
  return fmt::format(" ({})", fmt::join(names, ", "));
}

YamlNode& item_for_override(YamlNode& list, const std::string& part, const std::string& path) {
  // One spelling of each index: 0, never 00.
  const bool digits =
      part.find_first_not_of("0123456789") == std::string::npos && (part == "0" || part.front() != '0');
  const std::optional<double> index = digits ? parse_number(part) : std::nullopt;
  if (index && *index < static_cast<double>(list.items.size()))
    return list.items[static_cast<std::size_t>(*index)];
  throw input_error(
      "--set " + path, fmt::format("\"{}\" for a list of {}", part, list.items.size()),
      list.items.empty() ? "a list with items" : fmt::format("an index from 0 to {}", list.items.size() - 1));
}

/// The child that the next key of an override's path names; added to the map if missing.
YamlNode& child_for_override(YamlNode& node, const std::string& part, const std::string& path,
                             const std::shared_ptr<const std::string>& origin) {
  if (node.kind == YamlNode::Kind::null) node.kind = YamlNode::Kind::map;
  if (node.kind == YamlNode::Kind::sequence) return item_for_override(node, part, path);
  if (node.kind != YamlNode::Kind::map)
    throw input_error("--set " + path, fmt::format("\"{}\" within {}", part, node.described()),
                      "a path through mappings and lists");
  if (YamlNode* found = node.find(part)) return *found;
  YamlNode fresh;
  fresh.file = origin;
  return yaml_put(node, part, std::move(fresh));
}

bool are_named(const YamlNode& list) {
  return list.kind == YamlNode::Kind::sequence && std::ranges::all_of(list.items, [](const YamlNode& item) {
           const YamlNode* name = item.find("name");
           return name && name->kind == YamlNode::Kind::scalar;
         });
}

void put_rows_over(YamlNode& base, const YamlNode& over) {
  decltype(base.items) rows;
  for (const YamlNode& row : over.items) {
    const auto found = std::ranges::find_if(
        base.items, [&](const YamlNode& each) { return each.find("name")->text == row.find("name")->text; });
    if (found == base.items.end())
      rows.push_back(row);
    else
      put_over(*found, row);
  }
  for (const YamlNode& row : std::as_const(base.items)) rows.push_back(row);
  base.items = std::move(rows);
}

std::vector<std::string> parts_of(const std::string& path) {
  std::vector<std::string> parts(1);
  for (const char c : path) {
    if (c == '.')
      parts.emplace_back();
    else
      parts.back() += c;
  }
  if (parts.size() > kYamlMaxDepth)
    throw input_error("--set", fmt::format("a path of {} keys", parts.size()),
                      fmt::format("at most {} keys", kYamlMaxDepth));
  for (const std::string& part : parts)
    if (part.empty())
      throw input_error("--set", fmt::format("\"{}\"", printable(path)),
                        "a path of keys with single dots between them");
  return parts;
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

void put_over(YamlNode& base, const YamlNode& over) {
  using Kind = YamlNode::Kind;
  if (base.kind == Kind::map && over.kind == Kind::map) {
    for (const YamlEntry& entry : over.entries)
      if (YamlNode* found = base.find(entry.key))
        put_over(*found, entry.value);
      else
        base.entries.push_back(entry);
  } else if (are_named(base) && are_named(over)) {
    put_rows_over(base, over);
  } else {
    base = over;
  }
}

std::optional<std::filesystem::path> named_file(const YamlNode& node, std::string_view key) {
  if (node.kind != YamlNode::Kind::scalar) return std::nullopt;
  std::filesystem::path beside = path_beside(node);
  if (is_file(beside)) return beside;
  const std::string_view folder = shipped_folder(key);
  return folder.empty() ? std::nullopt : shipped_file(node.text, folder);
}

std::string need_file(const YamlNode& node, std::string_view key, std::string_view what) {
  const std::string_view folder = shipped_folder(key);
  std::string need = fmt::format("the path of a {} file, relative to this file", what);
  if (folder.empty()) return need;
  need += ", or the name of a shipped one";
  // The user's own file without its ending.
  const std::filesystem::path own = path_beside(node).string() + ".yaml";
  if (is_file(own)) return need + " (nearest: " + node.text + ".yaml)";
  return need + shipped_hint(node, folder);
}

void follow_reference(YamlNode& node, const std::string& key, YamlBudget& budget) {
  if (node.kind != YamlNode::Kind::scalar) return;
  const auto file = named_file(node, key);
  if (!file)
    throw Error(std::vector<Problem>{
        {node.place(), key, node.described() + ", which is not a file", need_file(node, key, "YAML")}});
  node = load_yaml(*file, budget);
}

void apply_override(YamlNode& root, std::string_view assignment, YamlBudget& budget) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos || equals == 0)
    throw input_error("--set", fmt::format("\"{}\"", assignment), "key.path=value");
  const std::string path(assignment.substr(0, equals));
  const auto origin = std::make_shared<const std::string>("--set " + path);
  YamlNode* node = &root;
  std::string key;  // of the node
  for (const std::string& part : parts_of(path)) {
    // Other text is not a file name; child_for_override() reports it.
    if (named_file(*node, key)) follow_reference(*node, key, budget);
    node = &child_for_override(*node, part, path, origin);
    key += (key.empty() ? "" : ".") + part;
  }
  *node = parse_yaml(std::string(assignment.substr(equals + 1)), *origin, budget);
}

void apply_override(YamlNode& root, std::string_view assignment) {
  YamlBudget budget;
  apply_override(root, assignment, budget);
}

}  // namespace handsim
