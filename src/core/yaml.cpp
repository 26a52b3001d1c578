#include "handsim/core/yaml.h"
#include "handsim/core/units.h"

#include <yaml-cpp/emitter.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include <fmt/format.h>

namespace handsim {

namespace {

/// Builds the tree from yaml-cpp's events; yaml-cpp's own Node drops places and duplicate keys.
class TreeBuilder : public YAML::EventHandler {
 public:
  explicit TreeBuilder(std::shared_ptr<const std::string> file) : file_(std::move(file)) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { add(made(mark), anchor); }

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    if (found == anchors_.end()) {
      problem(mark, "an alias to a value that contains it", "an alias to a value that is complete");
      throw Error(problems_);
    }
    YamlNode copy = found->second.node;
    count(mark, found->second.nodes);
    copy.line = mark.line + 1;
    copy.column = mark.column + 1;
    add(std::move(copy), 0, found->second.nodes);
  }

  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    YamlNode node = made(mark);
    node.kind = YamlNode::Kind::scalar;
    node.text = value;
    node.quoted = tag == "!";
    if (tag.size() > 1) problem(mark, "the tag " + tag, "a value without a tag");
    add(std::move(node), anchor);
  }

  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(mark, YamlNode::Kind::sequence, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(mark, YamlNode::Kind::map, anchor);
  }
  void OnMapEnd() override { close(); }

  YamlNode root;
  std::vector<Problem>& problems() { return problems_; }

 private:
  struct Anchored {
    YamlNode node;
    int nodes = 1;
  };
  /// A container being filled.
  struct Level {
    YamlNode node;
    YAML::anchor_t anchor = 0;
    std::optional<YamlEntry> pending;  ///< a map's key whose value comes next
    int nodes = 1;
  };

  YamlNode made(const YAML::Mark& mark) {
    count(mark, 1);
    YamlNode node;
    node.file = file_;
    node.line = mark.line + 1;
    node.column = mark.column + 1;
    return node;
  }

  void count(const YAML::Mark& mark, int nodes) {
    total_ += nodes;
    if (total_ <= kYamlMaxNodes) return;
    problem(mark, fmt::format("more than {} values", kYamlMaxNodes), fmt::format("at most {} values", kYamlMaxNodes));
    throw Error(problems_);
  }

  void problem(const YAML::Mark& mark, std::string got, std::string need) {
    problems_.push_back({Place{*file_, mark.line + 1, mark.column + 1}, "", std::move(got), std::move(need)});
  }

  void open(const YAML::Mark& mark, YamlNode::Kind kind, YAML::anchor_t anchor) {
    Level level;
    level.node = made(mark);
    level.node.kind = kind;
    level.anchor = anchor;
    levels_.push_back(std::move(level));
    if (static_cast<int>(levels_.size()) > kYamlMaxDepth) {
      problem(mark, fmt::format("more than {} levels of nesting", kYamlMaxDepth),
              fmt::format("at most {} levels", kYamlMaxDepth));
      throw Error(problems_);
    }
  }

  void close() {
    Level level = std::move(levels_.back());
    levels_.pop_back();
    add(std::move(level.node), level.anchor, level.nodes);
  }

  void add(YamlNode node, YAML::anchor_t anchor, int nodes = 1) {
    if (anchor != 0) anchors_[anchor] = {node, nodes};
    if (levels_.empty()) {
      root = std::move(node);
      return;
    }
    Level& level = levels_.back();
    level.nodes += nodes;
    if (level.node.kind == YamlNode::Kind::sequence) {
      level.node.items.push_back(std::move(node));
    } else if (!level.pending) {
      add_key(level, node);
    } else {
      level.pending->value = std::move(node);
      level.node.entries.push_back(std::move(*level.pending));
      level.pending.reset();
    }
  }

  void add_key(Level& level, const YamlNode& node) {
    if (node.kind != YamlNode::Kind::scalar)
      problems_.push_back({node.place(), "", node.described() + " as a key", "a word as a key"});
    for (const YamlEntry& entry : level.node.entries)
      if (entry.key == node.text && node.kind == YamlNode::Kind::scalar)
        problems_.push_back({node.place(), "",
                             fmt::format("a second \"{}\" (the first is in line {})", node.text, entry.line),
                             "each key once"});
    level.pending = YamlEntry{node.text, node.line, node.column, {}};
  }

  std::shared_ptr<const std::string> file_;
  std::vector<Level> levels_;
  std::map<YAML::anchor_t, Anchored> anchors_;
  std::vector<Problem> problems_;
  int total_ = 0;
};

bool plain_list(const YamlNode& node) {
  for (const YamlNode& item : node.items)
    if (item.kind == YamlNode::Kind::sequence || item.kind == YamlNode::Kind::map) return false;
  return true;
}

void emit(YAML::Emitter& out, const YamlNode& node) {
  switch (node.kind) {
    case YamlNode::Kind::null:
      out << YAML::Null;
      return;
    case YamlNode::Kind::scalar:
      if (node.quoted) out << YAML::DoubleQuoted;
      out << node.text;
      return;
    case YamlNode::Kind::sequence:
      if (plain_list(node)) out << YAML::Flow;
      out << YAML::BeginSeq;
      for (const YamlNode& item : node.items) emit(out, item);
      out << YAML::EndSeq;
      return;
    case YamlNode::Kind::map:
      out << YAML::BeginMap;
      for (const YamlEntry& entry : node.entries) {
        out << YAML::Key << entry.key << YAML::Value;
        emit(out, entry.value);
      }
      out << YAML::EndMap;
      return;
  }
}

/// The step of an override's path from a node to its child, made where a map lacks it.
YamlNode& child_for_override(YamlNode& node, const std::string& part, const std::string& path) {
  if (node.kind == YamlNode::Kind::null) node.kind = YamlNode::Kind::map;
  if (node.kind == YamlNode::Kind::sequence) {
    std::size_t index = 0;
    const std::optional<double> number = parse_number(part);
    if (number && *number >= 0) index = static_cast<std::size_t>(*number);
    if (!number || part.find_first_not_of("0123456789") != std::string::npos || index >= node.items.size())
      throw input_error("--set " + path, fmt::format("\"{}\" for a list of {}", part, node.items.size()),
                        fmt::format("an index from 0 to {}", static_cast<int>(node.items.size()) - 1));
    return node.items[index];
  }
  if (node.kind != YamlNode::Kind::map)
    throw input_error("--set " + path, fmt::format("\"{}\" within {}", part, node.described()),
                      "a path through mappings and lists");
  if (YamlNode* found = node.find(part)) return *found;
  return yaml_put(node, part, {});
}

}  // namespace

YamlNode* YamlNode::find(std::string_view key) {
  for (YamlEntry& entry : entries)
    if (entry.key == key) return &entry.value;
  return nullptr;
}

const YamlNode* YamlNode::find(std::string_view key) const { return const_cast<YamlNode*>(this)->find(key); }

std::string YamlNode::described() const {
  switch (kind) {
    case Kind::null:
      return "nothing";
    case Kind::scalar: {
      const std::string shown = text.size() > 60 ? text.substr(0, 57) + "..." : text;
      return quoted ? "\"" + shown + "\"" : shown;
    }
    case Kind::sequence:
      return fmt::format("a list of {}", items.size());
    case Kind::map:
      return entries.empty() ? "an empty mapping" : fmt::format("a mapping with \"{}\"", entries.front().key);
  }
  return {};
}

YamlNode parse_yaml(const std::string& text, const std::string& name) {
  if (text.size() > kYamlMaxBytes)
    throw Error(std::vector<Problem>{{Place{name, 1, 1}, "", fmt::format("a file of {} bytes", text.size()),
                                      fmt::format("at most {} bytes of YAML", kYamlMaxBytes)}});
  TreeBuilder builder(std::make_shared<const std::string>(name));
  std::istringstream stream(text);
  try {
    YAML::Parser parser(stream);
    parser.HandleNextDocument(builder);
  } catch (const YAML::Exception& failure) {
    builder.problems().push_back(
        {Place{name, failure.mark.line + 1, failure.mark.column + 1}, "", "broken YAML (" + failure.msg + ")", "valid YAML"});
  }
  if (!builder.problems().empty()) throw Error(builder.problems());
  if (!builder.root.file) {
    builder.root.file = std::make_shared<const std::string>(name);
  }
  return std::move(builder.root);
}

YamlNode load_yaml(const std::filesystem::path& path) {
  std::error_code failure;
  const std::filesystem::file_status status = std::filesystem::status(path, failure);
  const auto bad = [&](const char* got) {
    return Error(std::vector<Problem>{{Place{path.string(), 1, 1}, "", got, "a readable YAML file"}});
  };
  if (!std::filesystem::exists(status)) throw bad("no such file");
  if (std::filesystem::is_directory(status)) throw bad("a directory");
  if (!std::filesystem::is_regular_file(status)) throw bad("no regular file");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw bad("a file that cannot be opened");
  const std::uintmax_t size = std::filesystem::file_size(path, failure);
  if (failure || size > kYamlMaxBytes) return parse_yaml(std::string(kYamlMaxBytes + 1, ' '), path.string());
  std::ostringstream text;
  text << stream.rdbuf();
  return parse_yaml(text.str(), path.string());
}

std::string emit_yaml(const YamlNode& node) {
  YAML::Emitter out;
  emit(out, node);
  return std::string(out.c_str()) + "\n";
}

YamlNode yaml_scalar(std::string text, bool quoted) {
  YamlNode node;
  node.kind = YamlNode::Kind::scalar;
  node.text = std::move(text);
  node.quoted = quoted;
  return node;
}

YamlNode yaml_map() {
  YamlNode node;
  node.kind = YamlNode::Kind::map;
  return node;
}

YamlNode yaml_sequence() {
  YamlNode node;
  node.kind = YamlNode::Kind::sequence;
  return node;
}

YamlNode& yaml_put(YamlNode& map, std::string key, YamlNode value) {
  map.kind = YamlNode::Kind::map;
  if (!value.file) {
    value.file = map.file;
    value.line = map.line;
    value.column = map.column;
  }
  if (YamlNode* found = map.find(key)) return *found = std::move(value);
  map.entries.push_back({std::move(key), value.line, value.column, std::move(value)});
  return map.entries.back().value;
}

void follow_reference(YamlNode& node, const std::string& key) {
  if (node.kind != YamlNode::Kind::scalar) return;
  const Place place = node.place();
  const std::filesystem::path path = std::filesystem::path(place.file).parent_path() / node.text;
  if (std::error_code failure; !std::filesystem::is_regular_file(path, failure))
    throw Error(std::vector<Problem>{{place, key, fmt::format("\"{}\", which is no file", path.lexically_normal().string()),
                                      "the path of a YAML file, relative to this file"}});
  node = load_yaml(path.lexically_normal());
}

void apply_override(YamlNode& root, std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos || equals == 0)
    throw input_error("--set", fmt::format("\"{}\"", assignment), "key.path=value");
  const std::string path(assignment.substr(0, equals));
  YamlNode* node = &root;
  std::istringstream parts(path);
  std::string part;
  while (std::getline(parts, part, '.')) {
    follow_reference(*node, path);
    node = &child_for_override(*node, part, path);
  }
  YamlNode value = parse_yaml(std::string(assignment.substr(equals + 1)), "--set " + path);
  *node = std::move(value);
}

}  // namespace handsim
