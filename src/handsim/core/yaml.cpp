#include "handsim/core/yaml.h"

#include <yaml-cpp/emitter.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <map>
#include <optional>
#include <sstream>
#include <unordered_map>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"

namespace handsim {

namespace {

/// Builds the tree from yaml-cpp's events. YAML::Node has places (Mark), but it silently drops one of two
/// equal keys, has no place for an alias, loses quotes, and expands aliases without limit.
class TreeBuilder : public YAML::EventHandler {
 public:
  TreeBuilder(std::shared_ptr<const std::string> file, YamlBudget& budget)
      : file_(std::move(file)), budget_(budget) {}

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents_ == 1) return;
    problem(mark, "a second document", "one document per file");
    throw Error(problems_);
  }
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { add(make_node(mark, {}), anchor); }

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    if (found == anchors_.end()) {
      problem(mark, "an alias to a value that contains it", "an alias to a value that is complete");
      throw Error(problems_);
    }
    spend(mark.line + 1, mark.column + 1, found->second.bytes);
    YamlNode copy = found->second.node;
    copy.line = mark.line + 1;
    copy.column = mark.column + 1;
    add(std::move(copy), 0, found->second.bytes);
  }

  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    YamlNode node = make_node(mark, value);
    node.kind = YamlNode::Kind::scalar;
    node.quoted = tag == "!";
    if (node.quoted) last_quoted_ = mark;
    check_tag(mark, tag);
    check_escapes(mark, value);
    add(std::move(node), anchor, kYamlNodeBytes + value.size());
  }

  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    check_tag(mark, tag);
    open(mark, YamlNode::Kind::sequence, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    check_tag(mark, tag);
    open(mark, YamlNode::Kind::map, anchor);
  }
  void OnMapEnd() override { close(); }

  YamlNode root;
  std::vector<Problem>& problems() { return problems_; }

  /// yaml-cpp accepts a text without a closing quote and ends it at the end of the file.
  void check_last_quote(const std::string& text) {
    if (!last_quoted_) return;
    const std::optional<std::size_t> open = offset_of(text, *last_quoted_);
    if (!open || (text[*open] != '"' && text[*open] != '\'')) return;
    const char quote = text[*open];
    for (std::size_t at = *open + 1; at < text.size(); ++at) {
      if (quote == '"' && text[at] == '\\')
        ++at;
      else if (quote == '\'' && text[at] == '\'' && at + 1 < text.size() && text[at + 1] == '\'')
        ++at;
      else if (text[at] == quote)
        return;
    }
    problem(*last_quoted_, "a quote that is not closed", fmt::format("a closing {}", quote));
  }

 private:
  struct Anchored {
    YamlNode node;
    std::size_t bytes = 0;
  };
  /// A container being filled.
  struct Level {
    YamlNode node;
    YAML::anchor_t anchor = 0;
    std::optional<YamlEntry> pending;            ///< a map's key whose value comes next
    std::unordered_map<std::string, int> lines;  ///< of the keys so far
    std::size_t bytes = kYamlNodeBytes;
  };

  YamlNode make_node(const YAML::Mark& mark, const std::string& text) {
    spend(mark.line + 1, mark.column + 1, kYamlNodeBytes + text.size());
    YamlNode node;
    node.text = text;
    node.file = file_;
    node.line = mark.line + 1;
    node.column = mark.column + 1;
    return node;
  }

  void spend(int line, int column, std::size_t bytes) {
    if (bytes > budget_.left) {
      problems_.push_back(
          {Place{*file_, line, column}, "", "values that take more than " + bytes_text(kYamlMaxMemory),
           fmt::format("at most {} ({} bytes for each value and its text), with aliases expanded "
                       "and all files and --set together",
                       bytes_text(kYamlMaxMemory), kYamlNodeBytes)});
      throw Error(problems_);
    }
    budget_.left -= bytes;
  }

  void problem(const YAML::Mark& mark, std::string got, std::string need) {
    problems_.push_back({Place{*file_, mark.line + 1, mark.column + 1}, "", std::move(got), std::move(need)});
    stop_if_many();
  }

  void stop_if_many() const {
    if (problems_.size() >= kMostProblems) throw Error(problems_);
  }

  /// Position of a mark in the text. yaml-cpp counts lines and columns in bytes, without the byte order mark.
  static std::optional<std::size_t> offset_of(const std::string& text, const YAML::Mark& mark) {
    std::size_t at = text.starts_with("\xef\xbb\xbf") ? 3 : 0;
    for (int line = 0; line < mark.line; ++line) {
      const std::size_t end = text.find('\n', at);
      if (end == std::string::npos) return std::nullopt;
      at = end + 1;
    }
    at += static_cast<std::size_t>(std::max(0, mark.column));
    return at < text.size() ? std::optional(at) : std::nullopt;
  }

  /// An escape in quotes may produce a character that is not allowed in the file and cannot be written back.
  void check_escapes(const YAML::Mark& mark, const std::string& value) {
    if (const auto bad = find_bad_byte(value); bad && bad->what.starts_with("U+"))
      problem(mark, bad->what, "characters of Unicode");
  }

  /// yaml-cpp gives `?` to plain values and `!` to quoted ones.
  void check_tag(const YAML::Mark& mark, const std::string& tag) {
    if (tag.size() > 1) problem(mark, "the tag " + tag, "a value without a tag");
  }

  void open(const YAML::Mark& mark, YamlNode::Kind kind, YAML::anchor_t anchor) {
    Level level;
    level.node = make_node(mark, {});
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
    add(std::move(level.node), level.anchor, level.bytes);
  }

  void add(YamlNode node, YAML::anchor_t anchor, std::size_t bytes = kYamlNodeBytes) {
    if (anchor != 0) {
      // The copy counts, too: nested anchors could otherwise need unlimited memory.
      spend(node.line, node.column, bytes);
      anchors_[anchor] = {node, bytes};
    }
    if (levels_.empty()) {
      root = std::move(node);
      return;
    }
    Level& level = levels_.back();
    level.bytes += bytes;
    if (level.node.kind == YamlNode::Kind::sequence) {
      level.node.items.push_back(std::move(node));
    } else if (!level.pending) {
      add_key(level, node);
    } else {
      level.pending->value = std::move(node);
      // yaml-cpp reports the next token as the place of a missing value.
      if (YamlNode& value = level.pending->value; value.kind == YamlNode::Kind::null) {
        value.line = level.pending->line;
        value.column = level.pending->column;
      }
      level.node.entries.push_back(std::move(*level.pending));
      level.pending.reset();
    }
  }

  void add_key(Level& level, const YamlNode& node) {
    if (node.kind != YamlNode::Kind::scalar) {
      problems_.push_back({node.place(), "", node.described() + " as a key", "a word as a key"});
    } else if (const auto [first, fresh] = level.lines.emplace(node.text, node.line); !fresh) {
      problems_.push_back(
          {node.place(), "",
           fmt::format("a second \"{}\" (the first is in line {})", printable(node.text), first->second),
           "each key once"});
    }
    stop_if_many();
    level.pending = YamlEntry{node.text, node.line, node.column, {}};
  }

  std::shared_ptr<const std::string> file_;
  std::vector<Level> levels_;
  std::map<YAML::anchor_t, Anchored> anchors_;
  std::vector<Problem> problems_;
  std::optional<YAML::Mark> last_quoted_;
  YamlBudget& budget_;
  int documents_ = 0;
};

bool plain_list(const YamlNode& node) {
  return std::ranges::none_of(node.items, [](const YamlNode& item) {
    return item.kind == YamlNode::Kind::sequence || item.kind == YamlNode::Kind::map;
  });
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

YamlNode empty_node(YamlNode::Kind kind) {
  YamlNode node;
  node.kind = kind;
  return node;
}

/// The first tab up to line `last` that indents a line. yaml-cpp reports the text after it instead.
std::optional<Place> first_tab(const std::string& text, const Place& last) {
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; number <= last.line && std::getline(lines, line); ++number) {
    const std::size_t at = line.find_first_not_of(' ');
    if (at != std::string::npos && line[at] == '\t')
      return Place{last.file, number, static_cast<int>(at) + 1};
  }
  return std::nullopt;
}

/// @throws Error (input) if the file is too large, or at the first byte that is not text.
void check_text(std::string_view text, const std::string& name) {
  if (text.size() > kYamlMaxBytes)
    throw Error(std::vector<Problem>{{Place{name, 1, 1}, "", fmt::format("a file of {} bytes", text.size()),
                                      "at most " + bytes_text(kYamlMaxBytes)}});
  const std::optional<BadByte> bad = find_bad_byte(text);
  if (!bad) return;
  const std::string_view before = text.substr(0, bad->at);
  const std::size_t line_start = before.find_last_of('\n') + 1;
  const auto line = 1 + std::ranges::count(before, '\n');
  const Place place{name, static_cast<int>(line), static_cast<int>(bad->at - line_start) + 1};
  throw Error(std::vector<Problem>{{place, "", bad->what, "a YAML file, text in UTF-8"}});
}

}  // namespace

YamlNode* YamlNode::find(std::string_view key) {
  // What a map does not have is no reason to make its entries its own.
  if (!std::as_const(*this).find(key)) return nullptr;
  for (YamlEntry& entry : entries)
    if (entry.key == key) return &entry.value;
  return nullptr;
}

const YamlNode* YamlNode::find(std::string_view key) const {
  for (const YamlEntry& entry : entries)
    if (entry.key == key) return &entry.value;
  return nullptr;
}

bool YamlNode::same_as(const YamlNode& other) const {
  const bool same_file = file == other.file || (file && other.file && *file == *other.file);
  if (kind != other.kind || line != other.line || column != other.column || quoted != other.quoted ||
      text != other.text || !same_file)
    return false;
  return (items.is(other.items) ||
          std::equal(items.begin(), items.end(), other.items.begin(), other.items.end(),
                     [](const YamlNode& a, const YamlNode& b) { return a.same_as(b); })) &&
         (entries.is(other.entries) || std::equal(entries.begin(), entries.end(), other.entries.begin(),
                                                  other.entries.end(), [](const auto& a, const auto& b) {
                                                    return a.key == b.key && a.line == b.line &&
                                                           a.column == b.column && a.value.same_as(b.value);
                                                  }));
}

std::string YamlNode::described() const {
  switch (kind) {
    case Kind::null:
      return "nothing";
    case Kind::scalar: {
      const std::string shown = printable(text);
      return quoted || text.empty() ? "\"" + shown + "\"" : shown;
    }
    case Kind::sequence:
      return items.empty() ? "an empty list" : fmt::format("a list of {}", items.size());
    case Kind::map:
      return entries.empty() ? "an empty mapping" : fmt::format("a mapping with \"{}\"", entries.front().key);
  }
  return {};
}

YamlNode parse_yaml(const std::string& text, const std::string& name, YamlBudget& budget) {
  check_text(text, name);
  const YamlBudget whole = budget;
  TreeBuilder builder(std::make_shared<const std::string>(name), budget);
  std::istringstream stream(text);
  try {
    YAML::Parser parser(stream);
    while (parser.HandleNextDocument(builder)) {
    }
    builder.check_last_quote(text);
  } catch (const YAML::Exception& failure) {
    // Without a final line end yaml-cpp reports the end of the text instead of the quote.
    if (failure.msg == YAML::ErrorMsg::EOF_IN_SCALAR && !text.ends_with('\n')) {
      budget = whole;
      return parse_yaml(text + "\n", name, budget);
    }
    // yaml-cpp marks an unknown place with -1.
    const Place place{name, std::max(1, failure.mark.line + 1), std::max(1, failure.mark.column + 1)};
    const std::optional<Place> tab = first_tab(text, place);
    builder.problems().push_back(
        tab ? Problem{tab, "", "a tab as indentation", "spaces"}
            : Problem{place, "", "invalid YAML (" + failure.msg + ")", "valid YAML"});
  }
  if (!builder.problems().empty()) throw Error(builder.problems());
  if (!builder.root.file) builder.root.file = std::make_shared<const std::string>(name);
  return std::move(builder.root);
}

YamlNode parse_yaml(const std::string& text, const std::string& name) {
  YamlBudget budget;
  return parse_yaml(text, name, budget);
}

std::string emit_yaml(const YamlNode& node) {
  YAML::Emitter out;
  emit(out, node);
  return std::string(out.c_str()) + "\n";
}

YamlNode yaml_scalar(std::string text, bool quoted) {
  YamlNode node = empty_node(YamlNode::Kind::scalar);
  node.text = std::move(text);
  node.quoted = quoted;
  return node;
}

YamlNode yaml_map() { return empty_node(YamlNode::Kind::map); }

YamlNode yaml_map(const YamlNode& place) {
  YamlNode node = yaml_map();
  node.file = place.file;
  node.line = place.line;
  node.column = place.column;
  return node;
}

YamlNode yaml_sequence() { return empty_node(YamlNode::Kind::sequence); }

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

bool take_key(std::string_view& path, std::string_view key) {
  if (!path.starts_with(key) || (path.size() > key.size() && path[key.size()] != '.')) return false;
  path.remove_prefix(std::min(path.size(), key.size() + 1));
  return true;
}

namespace {

template <class Node>
Node* at_path(Node& node, std::string_view path) {
  if (path.empty()) return &node;
  if (node.kind == YamlNode::Kind::sequence) {
    const std::string_view head = path.substr(0, path.find('.'));
    const std::optional<double> index = parse_number(head);
    if (!index || !(*index >= 0 && *index < static_cast<double>(node.items.size()))) return nullptr;
    take_key(path, head);
    return at_path(node.items[static_cast<std::size_t>(*index)], path);
  }
  decltype(&node.entries.front()) found = nullptr;
  for (auto& each : node.entries)
    if (std::string_view rest = path;
        take_key(rest, each.key) && (!found || each.key.size() > found->key.size()))
      found = &each;
  if (!found) return nullptr;
  take_key(path, found->key);
  return at_path(found->value, path);
}

}  // namespace

YamlNode* value_at(YamlNode& root, std::string_view path) { return at_path(root, path); }

const YamlNode* value_at(const YamlNode& root, std::string_view path) { return at_path(root, path); }

}  // namespace handsim
