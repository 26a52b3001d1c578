#include "handsim/scene/inputs.h"

#include <algorithm>
#include <fstream>
#include <functional>
#include <iterator>

#include <fmt/format.h>

#include "handsim/control/motion_file.h"

namespace handsim::scene {

namespace {

using Visit = std::function<void(YamlNode& path)>;

/// `mesh` of a shape.
void visit_mesh(YamlNode& solid, const Visit& visit) {
  if (YamlNode* mesh = solid.find("mesh")) visit(*mesh);
}

/// Every value that is the path of a file. All other references have been filled in.
void each_path(YamlNode& scene, const Visit& visit) {
  if (YamlNode* objects = scene.find("objects"))
    for (YamlNode& object : objects->items) {
      visit_mesh(object, visit);
      if (YamlNode* parts = object.find("parts"))
        for (YamlNode& part : parts->items) visit_mesh(part, visit);
    }
  if (YamlNode* bodies = scene.find("bodies"))
    for (YamlNode& body : bodies->items)
      if (YamlNode* shape = body.find("shape")) visit_mesh(*shape, visit);
  YamlNode* control = scene.find("control");
  YamlNode* program = control ? control->find("program") : nullptr;
  const auto visit_program = [&](YamlNode& choice) {
    if (choice.kind == YamlNode::Kind::scalar && control::is_motion_file(choice.text)) visit(choice);
  };
  if (!program) return;
  visit_program(*program);
  for (YamlEntry& hand : program->entries) visit_program(hand.value);
}

/// A file name that every system takes.
std::string plain_name(const std::filesystem::path& path) {
  constexpr std::size_t kLongest = 60;
  const auto plain = [](std::string text) {
    std::replace_if(
        text.begin(), text.end(),
        [](char c) {
          const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
          return !letter && c != '.' && c != '_' && c != '-';
        },
        '_');
    return text.substr(0, kLongest);
  };
  return plain(path.stem().string()) + plain(path.extension().string());
}

std::string numbered(const std::string& name, int number) {
  const std::filesystem::path path(name);
  return fmt::format("{}-{}{}", path.stem().string(), number, path.extension().string());
}

std::string bytes_of(const std::filesystem::path& path, const YamlNode& node) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw Error(std::vector<Problem>{{node.place(), "", path.string() + ", which cannot be read", "a file"}});
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Values as the reader counts them: keys as well.
std::size_t size_of(const YamlNode& node) {
  std::size_t size = 1;
  for (const YamlNode& item : node.items) size += size_of(item);
  for (const YamlEntry& entry : node.entries) size += 1 + size_of(entry.value);
  return size;
}

}  // namespace

std::vector<InputFile> collect_inputs(YamlNode& resolved) {
  std::vector<InputFile> out;
  each_path(resolved, [&](YamlNode& node) {
    const std::filesystem::path path(node.text);
    const auto same = [&](const InputFile& file) { return file.path == path; };
    if (std::any_of(out.begin(), out.end(), same)) return;
    const std::string name = plain_name(path);
    std::string copy = "inputs/" + name;
    const auto taken = [&](const InputFile& file) { return file.copy == copy; };
    for (int number = 2; std::any_of(out.begin(), out.end(), taken); ++number)
      copy = "inputs/" + numbered(name, number);
    out.push_back({path, copy, std::make_shared<const std::string>(bytes_of(path, node))});
  });
  return out;
}

YamlNode standalone(YamlNode resolved, const std::vector<InputFile>& inputs) {
  each_path(resolved, [&](YamlNode& node) {
    for (const InputFile& file : inputs)
      if (node.text == file.path.string()) {
        node.text = file.copy;
        return;
      }
  });
  return resolved;
}

std::string standalone_text(const YamlNode& resolved, const std::vector<InputFile>& inputs) {
  const auto refuse = [&](std::string got, std::string need) {
    Place place = resolved.place();
    throw Error(std::vector<Problem>{{place, "", std::move(got), std::move(need)}});
  };
  const YamlNode alone = standalone(resolved, inputs);
  if (const std::size_t size = size_of(alone); size > static_cast<std::size_t>(kYamlMaxNodes))
    refuse(fmt::format("a scene of {} values with the files it names", size),
           fmt::format("at most {}, so that resolved.yaml can be read again", kYamlMaxNodes));
  std::string text = emit_yaml(alone);
  if (text.size() > kYamlMaxBytes)
    refuse(fmt::format("a scene of {} bytes with the files it names", text.size()),
           fmt::format("at most {}, so that resolved.yaml can be read again", kYamlMaxBytes));
  return text;
}

}  // namespace handsim::scene
