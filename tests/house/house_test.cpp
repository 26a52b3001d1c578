// Who may include what: USES lines against the includes that are there, and third-party headers in their
// rooms. And where a header's functions stand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "places.h"

namespace handsim::test {
namespace {

namespace fs = std::filesystem;

const fs::path kSource = fs::path(test::in_source("src/handsim"));

struct File {
  std::string folder;                  ///< below src/handsim/
  std::vector<std::string> own;        ///< `handsim/...` headers, without `handsim/`
  std::vector<std::string> libraries;  ///< headers between angle brackets
};

/// Every source and header by its path below src/handsim/.
std::map<std::string, File> sources() {
  const std::regex include(R"re(#include ([<"])([^>"]+)[>"])re");
  std::map<std::string, File> out;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(kSource)) {
    if (entry.path().extension() != ".h" && entry.path().extension() != ".cpp") continue;
    const fs::path path = fs::relative(entry.path(), kSource);
    File& file = out[path.string()];
    file.folder = path.parent_path().string();
    std::ifstream text(entry.path());
    std::smatch match;
    for (std::string line; std::getline(text, line);) {
      if (!std::regex_search(line, match, include)) continue;
      const std::string header = match[2];
      if (match[1] == "<")
        file.libraries.push_back(header);
      else if (header.starts_with("handsim/"))
        file.own.push_back(header.substr(8));
    }
  }
  return out;
}

void reach(const std::map<std::string, File>& all, const std::string& path, std::set<std::string>& seen) {
  const auto file = all.find(path);
  if (file == all.end()) return;  // made by the build
  for (const std::string& header : file->second.own)
    if (seen.insert(header).second) reach(all, header, seen);
}

// Oracle: the includes themselves, and those of the headers that they name. A name too few and
// a name too many both fail here.
TEST(House, AFolderUsesWhatItsUsesLineNamesAndNothingElse) {
  const std::map<std::string, File> all = sources();
  std::map<std::string, std::set<std::string>> found;
  for (const auto& [path, file] : all) {
    if (path == "app/main.cpp") continue;
    std::set<std::string> headers;
    reach(all, path, headers);
    for (const std::string& header : headers)
      found[file.folder].insert(fs::path(header).parent_path().string());
  }
  std::ifstream lines(HANDSIM_USES_FILE);
  int folders = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string folder;
    words >> folder;
    if (folder.empty()) continue;
    ++folders;
    std::set<std::string> named;
    for (std::string word; words >> word;) named.insert(word);
    found[folder].erase(folder);
    EXPECT_EQ(named, found[folder]) << folder;
  }
  EXPECT_GT(folders, 20);
}

// Oracle: the design: what may change its mind about a library is one folder, or one file.
TEST(House, ThirdPartyHeadersStayInTheirRooms) {
  const std::vector<std::pair<std::string, std::string>> rooms = {
      {"ode/", "engine/(ode|collision)/"},
      {"GL/", "output/render/"},
      {"cairo", "output/render/"},
      {"png.h", "output/render/"},
      {"yaml-cpp/", "core/yaml"},
      {"xxhash", "core/archive"},
      {"libqhull", "core/qhull"},
      {"ida/", "engine/dae/"},
      {"CLI/", "app/"},
      {"nlohmann/", "(simulation|study|app)/|core/schema|output/description/"},
      {"Random123/", "environment/draws"},
      {"mujoco/", "none"},
  };
  std::map<std::string, int> met;
  for (const auto& [path, file] : sources())
    for (const std::string& header : file.libraries)
      for (const auto& [library, room] : rooms)
        if (header.starts_with(library)) {
          ++met[library];
          EXPECT_TRUE(std::regex_search(path, std::regex("^" + room)))
              << path << " includes <" << header << ">";
        }
  // Every library above but the one that none may include is met somewhere.
  EXPECT_EQ(met.size(), rooms.size() - 1);
}

/// A file's text without comments, literals and preprocessor lines.
std::string bare_text(const fs::path& path) {
  std::ifstream file(path);
  std::string out, line;
  while (std::getline(file, line))
    if (!line.starts_with('#')) out += line.substr(0, line.find("//")) + "\n";
  return std::regex_replace(out, std::regex(R"re("(\\.|[^"\\\n])*"|'(\\.|[^'\\\n])')re"), "0");
}

/// The name of the function that a statement declares, or nothing: no function, or one that a header defines.
std::string function_of(std::string statement) {
  static const std::regex arguments("<[^<>]*>"), name(R"((?:^|[^\w:])(\w+)\s*\()"),
      other(
          R"(^\s*(using|typedef|struct|class|enum|template|extern|friend|inline|constexpr|static_assert)\b)");
  if (std::regex_search(statement, other)) return "";
  for (std::string shorter; (shorter = std::regex_replace(statement, arguments, "")) != statement;)
    statement = shorter;
  std::smatch match;
  return std::regex_search(statement, match, name) ? match[1].str() : "";
}

/// Names of the functions at namespace scope that a file declares, and of those that it defines.
struct Functions {
  std::set<std::string> declared, defined;
};

Functions functions_of(const fs::path& path) {
  Functions out;
  const std::regex opens_namespace(R"(\bnamespace\b)");
  std::string statement;
  int inside = 0;  // of braces that are no namespace's
  for (const char c : bare_text(path)) {
    if (c == '{' && inside == 0 && std::regex_search(statement, opens_namespace)) {
      statement.clear();
    } else if (c == '{') {
      if (inside++ == 0) out.defined.insert(function_of(statement));
    } else if (c == '}' && inside > 0) {
      --inside;
      statement.clear();
    } else if (c == ';') {
      if (inside == 0) out.declared.insert(function_of(statement));
      statement.clear();
    } else if (inside == 0) {
      statement += c == '\n' ? ' ' : c;
    }
  }
  out.declared.erase("");
  return out;
}

// Oracle: the design: a header's functions stand in the source of its name.
TEST(House, AHeadersFunctionsStandInTheSourceOfItsName) {
  // Folders in which this is not so yet; the list shrinks.
  std::set<std::string> not_yet = {"app", "output", "python", "simulation/run", "study"};
  // Functions whose source the build chooses: an engine's maker, a library that may be missing.
  const std::set<std::string> chosen = {"engine/checks.h make", "engine/settings.h missing_library"};
  std::set<std::string> unfinished;
  int held = 0;
  for (const auto& [path, file] : sources()) {
    if (!path.ends_with(".h")) continue;
    const std::set<std::string> defined =
        functions_of(fs::path(kSource / path).replace_extension(".cpp")).defined;
    for (const std::string& name : functions_of(kSource / path).declared) {
      const auto folder = std::find_if(
          not_yet.begin(), not_yet.end(),
          [&each_path = path](const std::string& each) { return each_path.starts_with(each + "/"); });
      const bool here = defined.contains(name) || chosen.contains(path + " " + name);
      if (folder == not_yet.end()) {
        EXPECT_TRUE(here) << path << " declares " << name;
        ++held;
      } else if (!here) {
        unfinished.insert(*folder);
      }
    }
  }
  EXPECT_EQ(unfinished, not_yet) << "take finished folders off the list";
  EXPECT_GT(held, 100);
}

bool has_any(const std::string& line, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return line.find(word) != std::string::npos; });
}

/// Paths below the checkout of files of src/handsim and python/handsim with a line of some kind.
std::set<std::string> files_with(bool (*wanted)(const std::string& line)) {
  std::set<std::string> out;
  const fs::path checkout = kSource.parent_path().parent_path();
  for (const fs::path& folder : {kSource, checkout / "python/handsim"})
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
      const fs::path extension = entry.path().extension();
      if (extension != ".h" && extension != ".cpp" && extension != ".py") continue;
      std::ifstream text(entry.path());
      for (std::string line; std::getline(text, line);)
        if (wanted(line)) out.insert(fs::relative(entry.path(), checkout).string());
    }
  return out;
}

/// A line that only makes a joint of some type, `kind = JointKind::hinge`, asks for none.
bool asks_for_joint_type(const std::string& line) {
  const std::size_t named = line.find("JointKind::");
  if (named != std::string::npos && std::islower(static_cast<unsigned char>(line[named + 11])) != 0 &&
      !has_any(line, {"kind = "}))
    return true;
  return has_any(line, {".turns", "type().slides", "joint.kind == ", "joint.kind != ", "joint.kind in ",
                        "joint.kind not in ", ".get(joint.kind", "[joint.kind"});
}

/// Files in the table below a paragraph of docs/inside.md.
std::set<std::string> files_of_table(const std::string& paragraph) {
  std::ifstream page(test::in_source("docs/inside.md"));
  std::set<std::string> out;
  const std::regex file("`([\\w/]+\\.(?:cpp|h|py))`");
  bool below = false;
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("**")) below = line.starts_with(paragraph);
    if (!below || !line.starts_with("| `")) continue;
    const std::string first = line.substr(0, line.find(" | "));
    for (std::sregex_iterator each(first.begin(), first.end(), file), end; each != end; ++each)
      out.insert((*each)[1]);
  }
  return out;
}

// Oracle: the sources. A file that asks for a joint's type is on the page, and what is on the page uses it.
TEST(House, TheFilesThatAJointTypeTouchesAreListed) {
  const std::set<std::string> listed = files_of_table("**A joint type.**");
  EXPECT_LE(listed.size(), 12U);
  const std::set<std::string> found = files_with(asks_for_joint_type);
  EXPECT_GT(found.size(), 5U);
  for (const std::string& file : found)
    EXPECT_TRUE(listed.contains(file)) << file << " asks for a joint's type";
  const std::set<std::string> used = files_with([](const std::string& line) {
    return has_any(line, {"slides", "turns", "spherical"});
  });
  for (const std::string& file : listed) EXPECT_TRUE(used.contains(file)) << file << " uses no joint's type";
}

}  // namespace
}  // namespace handsim::test
