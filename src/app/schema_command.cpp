#include <vector>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/file_readers.h"
#include "handsim/app/key_texts.h"
#include "handsim/core/schema.h"

namespace handsim::app {

int schema_command(const SchemaArguments& arguments) {
  std::vector<SchemaSource> sources;
  std::string_view kind;
  for (const FileReader& reader : file_readers()) {
    sources.push_back({scene::described(reader.kind), reader.read});
    if (reader.word == arguments.kind) kind = sources.back().kind;
  }
  print_text(json_schema(kind, sources, [](std::string_view of, std::string_view path) {
    for (const FileReader& reader : file_readers())
      if (scene::described(reader.kind) == of) return key_text(reader.word, path);
    return std::string();
  }));
  return 0;
}

}  // namespace handsim::app
