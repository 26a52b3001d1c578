#include "handsim/output/table/contact_table.h"

#include <iterator>

#include <fmt/format.h>

namespace handsim::output {

namespace {

constexpr std::size_t kFlushBytes = 1U << 18U;

}  // namespace

ContactTableWriter::ContactTableWriter(const std::filesystem::path& path, const model::Model& model)
    : model_(model),
      file_(path),
      buffer_(
          "time[s],a,b,x[m],y[m],z[m],normal.x,normal.y,normal.z,depth[m],normal_force[N],friction.x[N],"
          "friction.y[N],friction.z[N]\n") {}

void ContactTableWriter::add(double time, const ContactRow& row) {
  const auto name = [&](int shape) -> const std::string& {
    return model_.shapes[static_cast<std::size_t>(shape)].name;
  };
  const Vec3 &p = row.position, &n = row.normal, &f = row.friction;
  fmt::format_to(std::back_inserter(buffer_), "{:.12g},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", time,
                 name(row.shape_a), name(row.shape_b), p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), row.depth,
                 row.normal_force, f.x(), f.y(), f.z());
  if (buffer_.size() < kFlushBytes) return;
  file_.write(buffer_);
  buffer_.clear();
}

void ContactTableWriter::finish() {
  file_.write(buffer_);
  buffer_.clear();
  file_.commit();
}

}  // namespace handsim::output
