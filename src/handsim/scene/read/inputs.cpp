#include "handsim/scene/read/inputs.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/control/motion_file.h"
#include "handsim/core/input_file.h"

namespace handsim::scene {

namespace {

template <class Visit>
void each_scalar(YamlNode& node, const Visit& visit) {
  if (node.kind == YamlNode::Kind::scalar) visit(node);
  for (YamlNode& item : node.items) each_scalar(item, visit);
  for (YamlEntry& entry : node.entries) each_scalar(entry.value, visit);
}

constexpr const char* kFolder = "inputs";

/// True for characters that every file system allows.
bool is_plain(char c) {
  const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  return letter || c == '.' || c == '_' || c == '-';
}

std::string plain_name(const std::filesystem::path& path) {
  constexpr std::size_t kLongest = 60;
  const auto plain = [](std::string text) {
    std::replace_if(
        text.begin(), text.end(), [](char c) { return !is_plain(c); }, '_');
    return text.substr(0, kLongest);
  };
  return plain(path.stem().string()) + plain(path.extension().string());
}

std::string numbered(const std::string& name, int number) {
  const std::filesystem::path path(name);
  return fmt::format("{}-{}{}", path.stem().string(), number, path.extension().string());
}

/// Memory of a tree by the rule of the YAML reader.
std::size_t memory_of(const YamlNode& node) {
  std::size_t bytes = kYamlNodeBytes + node.text.size();
  for (const YamlNode& item : node.items) bytes += memory_of(item);
  for (const auto& entry : node.entries) bytes += kYamlNodeBytes + entry.key.size() + memory_of(entry.value);
  return bytes;
}

}  // namespace

std::vector<ReferencedFile> collect_inputs(const std::vector<std::filesystem::path>& files) {
  std::vector<ReferencedFile> out;
  for (const std::filesystem::path& path : files) {
    const auto same = [&](const ReferencedFile& file) { return file.path == path; };
    if (std::ranges::any_of(out, same)) continue;
    const std::string name = plain_name(path);
    std::string copy = fmt::format("{}/{}", kFolder, name);
    const auto taken = [&](const ReferencedFile& file) { return file.copy == copy; };
    for (int number = 2; std::ranges::any_of(out, taken); ++number)
      copy = fmt::format("{}/{}", kFolder, numbered(name, number));
    // No input file has a larger size limit than motion files.
    out.push_back({path, copy,
                   std::make_shared<const std::string>(
                       read_input_file(path, "a file that the scene reads", control::kMotionMaxBytes))});
  }
  return out;
}

YamlNode standalone(YamlNode resolved, const std::vector<ReferencedFile>& inputs) {
  if (inputs.empty()) return resolved;
  each_scalar(resolved, [&](YamlNode& node) {
    for (const ReferencedFile& file : inputs)
      if (node.text == file.path.string()) {
        node.text = file.copy;
        return;
      }
  });
  return resolved;
}

std::string standalone_text(const YamlNode& resolved, const std::vector<ReferencedFile>& inputs) {
  const auto check = [&](std::size_t bytes, std::size_t most, const char* what) {
    if (bytes > most)
      throw Error(std::vector<Problem>{
          {resolved.place(), "", fmt::format("a scene of {} bytes {}", bytes, what),
           fmt::format("at most {}, so that resolved.yaml can be read again", bytes_text(most))}});
  };
  const YamlNode alone = standalone(resolved, inputs);
  check(memory_of(alone), kYamlMaxMemory, "in memory with the files it names");
  std::string text = emit_yaml(alone);
  check(text.size(), kYamlMaxBytes, "with the files it names");
  return text;
}

std::vector<std::string> copies_named_in(const std::filesystem::path& resolved) {
  std::vector<std::string> out;
  const auto take = [&](const YamlNode& node) {
    const std::filesystem::path path(node.text);
    const std::string name = path.filename().string();
    if (path.parent_path() == kFolder && std::ranges::all_of(name, is_plain)) out.push_back(node.text);
  };
  try {
    YamlNode scene = load_yaml(resolved);
    each_scalar(scene, take);
  } catch (const Error&) {
    return {};
  }
  return out;
}

}  // namespace handsim::scene
