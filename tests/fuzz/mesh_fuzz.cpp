#include "fuzz/fuzz.h"
#include "handsim/scene/read/mesh_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace handsim;
  // The first byte says by which name the file goes.
  if (size == 0) return 0;
  const fuzz::File file(fuzz::text_of(data + 1, size - 1), data[0] % 2 == 0 ? ".obj" : ".stl");
  return fuzz::read([&] {
    const scene::LoadedMesh loaded = scene::load_convex_mesh(file.path(), 1.0);
    if (!loaded.centroid.allFinite() || loaded.mesh->face_count() < 4) __builtin_trap();
  });
}
