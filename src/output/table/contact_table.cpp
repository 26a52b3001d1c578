#include "handsim/output/table/contact_table.h"

#include <fmt/format.h>

namespace handsim::output {

ContactTableWriter::ContactTableWriter(const std::filesystem::path& path, const model::Model& model)
    : model_(model), file_(path) {
  file_.write(
      "time[s],a,b,x[m],y[m],z[m],normal.x,normal.y,normal.z,depth[m],normal_force[N],friction.x[N],"
      "friction.y[N],friction.z[N]\n");
}

void ContactTableWriter::add(double time, const ContactRow& row) {
  const auto name = [&](int shape) -> const std::string& {
    return model_.shapes[static_cast<std::size_t>(shape)].name;
  };
  const Vec3 &p = row.position, &n = row.normal, &f = row.friction;
  file_.write(fmt::format("{:.12g},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", time, name(row.shape_a),
                          name(row.shape_b), p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), row.depth,
                          row.normal_force, f.x(), f.y(), f.z()));
}

void ContactTableWriter::finish() { file_.commit(); }

}  // namespace handsim::output
