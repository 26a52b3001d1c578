// Replaces the renderer in a build without pictures (CMake option HANDSIM_PICTURES): every call throws.
#include "handsim/core/error.h"
#include "handsim/output/render/contact_sheet.h"
#include "handsim/output/render/renderer.h"

namespace handsim::output {

namespace {

[[noreturn]] void refuse() {
  throw input_error("handsim", "a build without pictures", "a build with -DHANDSIM_PICTURES=ON");
}

}  // namespace

void require_pictures() { refuse(); }
const char* name_of(Gl) { refuse(); }
std::vector<Gl> built_gls() { return {}; }
void write_png(const Image&, const std::filesystem::path&) { refuse(); }

struct ContactSheet::Page {};
ContactSheet::ContactSheet(const SheetFormat&) { refuse(); }
ContactSheet::~ContactSheet() = default;
void ContactSheet::add(const Image&, const std::string&, std::optional<double>) { refuse(); }
Image ContactSheet::image() const { refuse(); }

struct Renderer::Impl {};
Renderer::Renderer(int, int, std::optional<Gl>) { refuse(); }
Renderer::~Renderer() = default;
Image Renderer::draw(const DrawList&, const Camera&) { refuse(); }

}  // namespace handsim::output
