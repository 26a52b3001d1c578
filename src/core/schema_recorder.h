// What readers ask for while json_schema() runs them. Private to this folder.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "handsim/core/yaml_reader.h"

namespace handsim {

using Json = nlohmann::ordered_json;

/// What a reader takes under a key.
struct KeyForm {
  std::vector<Json> types;        ///< any of them; none: the reader only asks whether the key is there
  std::vector<YamlNode> samples;  ///< values to read on with, the usual one first
  bool required = false;
};

KeyForm asked_form();
KeyForm number_form(const Quantity& quantity, std::optional<double> fallback, bool required);
KeyForm integer_form(int min, int max, int fallback);
KeyForm text_form(const std::optional<std::string>& fallback, bool required);
KeyForm name_form();
KeyForm flag_form(bool fallback);
KeyForm vector_form(const Quantity& quantity, const std::optional<Vec3>& fallback);
KeyForm range_form(const Quantity& quantity, bool required);
KeyForm choice_form(const std::vector<std::string_view>& words, std::optional<std::string_view> fallback);
KeyForm texts_form(std::size_t least, std::size_t most, const std::string& need);
KeyForm list_form(std::size_t least, std::size_t most);
KeyForm map_form(bool required);
KeyForm value_form(const ValueForm& form);
/// A file, or a block in its place, whose keys the schema of its kind has.
KeyForm file_form(std::string_view kind, bool required);

/// Name of a kind of file within a schema: `hand_model` of `a hand model`.
std::string definition_name(std::string_view kind);

/// Gathers what all runs of a reader ask for.
class SchemaRecorder {
 public:
  /// A value for a key, under which the reader may ask for more.
  struct Setting {
    std::string path;
    YamlNode value;
    bool usual = true;
  };

  /// A map is read at this path.
  void visit(const std::string& path) { visited_.insert(path); }
  /// A key of the map at this path is a file or a block of this kind.
  void note_file(const std::string& path, std::string_view key, std::string_view kind, bool required);
  /// A key of the map at this path is asked for.
  void note(const std::string& path, std::string_view key, KeyForm form);
  /// Keys of the map at this path that were not asked for are refused.
  void close(const std::string& path) { at(path).closed = true; }

  const std::set<std::string>& kinds() const { return kinds_; }

  /// The settings that the run has brought up, each once in all runs.
  std::vector<Setting> end_run();
  Json schema() const { return build(root_); }

 private:
  struct Node {
    std::string key;  ///< `0`: items of a list, `*`: keys of any name
    std::vector<Json> types = {};
    std::vector<Node> children = {};
    std::optional<std::set<std::string>> required = {};  ///< in every run that came here
    bool closed = false;
  };

  Node& at(std::string_view path);
  static Json build(const Node& node);

  Node root_ = {};
  std::set<std::string> visited_;
  std::map<std::string, std::set<std::string>> required_;  ///< in this run
  std::set<std::pair<std::string, std::string>> known_;
  std::set<std::string> kinds_;  ///< of files that are named
  std::vector<Setting> found_;
};

}  // namespace handsim
