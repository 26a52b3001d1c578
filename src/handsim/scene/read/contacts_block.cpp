#include "handsim/scene/read/contacts_block.h"

#include "handsim/model/surface_reader.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

ContactRuleSpec read_rule(MapReader reader, const std::vector<model::Material>& materials) {
  ContactRuleSpec rule;
  rule.place = reader.node().place();
  if (const auto between = reader.texts("between", 2, 2, "two names of contact groups"); !between.empty())
    rule.between = {between[0], between[1]};
  if (reader.has("material") && named_material(reader, "material", materials))
    rule.material = reader.text("material");
  reader.finish();
  return rule;
}

bool has_key(const YamlNode& entry, const std::string& key) { return entry.find(key) != nullptr; }

model::Material read_sourced_material(MapReader& reader, const std::string& name) {
  for (const char* words : {"title", "source"}) reader.maybe_text(words);
  model::Material material = model::read_material(reader, name);
  reader.finish();
  return material;
}

}  // namespace

model::Material read_material_file(const YamlNode& root, Diagnostics& diagnostics) {
  if (!is_of_kind(root, "", FileKind::material, diagnostics)) return {};
  MapReader reader(root, "", diagnostics);
  return read_sourced_material(reader, "material");
}

std::optional<model::Material> named_material(MapReader& reader, std::string_view key,
                                              const std::vector<model::Material>& materials) {
  const std::string name = reader.text(key);
  std::vector<std::string> known;
  for (const model::Material& material : materials) {
    if (material.name == name) return material;
    known.push_back(material.name);
  }
  reader.problem(key, name,
                 known.empty() ? "a material of contacts.materials, which has none" : need_word(name, known));
  return std::nullopt;
}

ContactsSpec read_contacts(MapReader& scene) {
  ContactsSpec spec;
  if (!scene.has("contacts")) return spec;
  MapReader reader = scene.map("contacts");
  reader.each("materials", 0, kMostItems, [&](MapReader item) {
    if (!inline_file(item, FileKind::material, has_key)) return;
    if (item.has("file"))
      item.problem("file", "a file that refers to another", "a file with the material itself");
    const std::string name = item.name("name");
    for (const model::Material& other : spec.materials)
      if (!name.empty() && other.name == name)
        item.problem("name", name + " a second time", "a unique name for each material");
    spec.materials.push_back(read_sourced_material(item, name));
  });
  if (reader.has("rules")) spec.rules.emplace();
  reader.each("rules", 0, kMostItems,
              [&](MapReader rule) { spec.rules->push_back(read_rule(std::move(rule), spec.materials)); });
  reader.finish();
  return spec;
}

}  // namespace handsim::scene
