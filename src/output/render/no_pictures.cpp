// What stands for the renderer in a build without pictures (CMake option HANDSIM_PICTURES): all of it says
// so.
#include "handsim/core/error.h"
#include "handsim/output/render/contact_sheet.h"
#include "handsim/output/render/renderer.h"

namespace handsim::output {

namespace {

[[noreturn]] void refuse() {
  throw input_error("handsim", "a build without pictures", "one with -DHANDSIM_PICTURES=ON");
}

}  // namespace

void require_pictures() { refuse(); }
void write_png(const Image&, const std::filesystem::path&) { refuse(); }

struct ContactSheet::Page {};
ContactSheet::ContactSheet(const SheetFormat&) { refuse(); }
ContactSheet::~ContactSheet() = default;
ContactSheet::ContactSheet(ContactSheet&&) noexcept = default;
ContactSheet& ContactSheet::operator=(ContactSheet&&) noexcept = default;
void ContactSheet::add(const Image&, const std::string&) { refuse(); }
Image ContactSheet::image() const { refuse(); }

struct Renderer::Impl {};
Renderer::Renderer(int, int) { refuse(); }
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Image Renderer::draw(const DrawList&, const Camera&) { refuse(); }
int Renderer::contexts_created() { return 0; }

}  // namespace handsim::output
