// The accuracy study with rows of other engines: `peer_accuracy PEERS.yaml --out DIR [--peers FOLDER]`.
// `handsim accuracy` writes the files. PEERS.yaml names a study and has a row for each method of a program of
// this folder: `name`, `program`, `method`, `set`, `steps`, `line`.
#include <unistd.h>

#include <cstdio>
#include <string>

#include <fmt/format.h>

#include "handsim/core/yaml_reader.h"
#include "handsim/output/report/page.h"
#include "handsim/study/spec_reader.h"
#include "peers/peer_program.h"
#include "places.h"

namespace {

using namespace handsim;
using study::AccuracyMethod;
namespace fs = std::filesystem;

constexpr std::size_t kMostRows = 100;

/// `{accuracy: 1e-4}` as numbers.
std::vector<std::pair<std::string, double>> read_settings(MapReader& reader) {
  std::vector<std::pair<std::string, double>> settings;
  const YamlNode* map = reader.child("set");
  for (const YamlEntry& entry : map ? map->entries : decltype(map->entries)())
    if (const auto value = read_number(entry.value, "set." + entry.key, {}, reader.diagnostics()))
      settings.emplace_back(entry.key, *value);
  return settings;
}

/// @param steps of methods that have none of their own.
std::optional<AccuracyMethod> read_method(MapReader reader, const std::vector<double>& steps,
                                          const fs::path& folder) {
  AccuracyMethod method;
  method.name = reader.text("name");
  study::PeerMethod peer;
  peer.program = reader.name("program");
  peer.method = reader.name("method");
  peer.settings = read_settings(reader);
  if (reader.has("line")) method.line = reader.text("line");
  method.steps = study::read_steps(reader, "steps", false);
  if (method.steps.empty()) method.steps = steps;
  reader.finish();
  method.outside = study::outside_engine(folder, peer);
  if (access((folder / peer.program).c_str(), X_OK) == 0) return method;
  std::printf("left out: %s (there is no %s)\n", method.name.c_str(), (folder / peer.program).c_str());
  return std::nullopt;
}

/// A study, and its own file.
struct Asked {
  fs::path study;
  study::AccuracySpec spec;
};

Asked read(const fs::path& file, const fs::path& folder) {
  YamlNode root = load_yaml(file);
  Diagnostics diagnostics;
  MapReader reader(root, "", diagnostics);
  Asked asked;
  asked.study = file.parent_path() / reader.text("study");
  asked.spec = study::load_accuracy(asked.study);
  const std::vector<double> steps = asked.spec.methods.at(0).steps;
  const YamlNode* rows = reader.list("peers", true, kMostRows);
  for (std::size_t i = 0; rows && i < rows->items.size(); ++i)
    if (auto method =
            read_method(MapReader(rows->items[i], fmt::format("peers.{}", i), diagnostics), steps, folder))
      asked.spec.methods.push_back(std::move(*method));
  reader.finish();
  diagnostics.throw_if_any();
  return asked;
}

}  // namespace

int main(int argc, char** argv) {
  fs::path file, out, folder = fs::path(argv[0]).parent_path();
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool option = (word == "--out" || word == "--peers") && i + 1 < argc;
    fs::path& value = !option ? file : word == "--out" ? out : folder;
    value = argv[option ? ++i : i];
  }
  if (file.empty() || out.empty()) {
    std::fprintf(stderr, "usage: peer_accuracy PEERS.yaml --out DIR [--peers FOLDER]\n");
    return 2;
  }
  try {
    const Asked asked = read(file, folder);
    const std::string rows = study::rows_text(asked.spec, study::run_accuracy(asked.spec, nullptr));
    std::fflush(stdout);
    const auto word = [](const fs::path& path) { return output::shell_word(path.string()); };
    FILE* files =
        popen(fmt::format("{} accuracy --rows {} {}", word(test::kProgramFile), word(asked.study), word(out))
                  .c_str(),
              "w");
    if (!files) throw input_error(test::kProgramFile, "no shell for it", "the program that writes the files");
    const bool whole = std::fwrite(rows.data(), 1, rows.size(), files) == rows.size();
    return pclose(files) == 0 && whole ? 0 : 1;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
