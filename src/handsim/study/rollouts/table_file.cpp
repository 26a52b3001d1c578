#include "handsim/study/rollouts/table_file.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <hdf5.h>

#include "handsim/core/error.h"
#include "handsim/output/atomic_file.h"

namespace handsim::study {

namespace {

struct Failed {};

/// An HDF5 object, closed with its own function.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {
    if (id_ < 0) throw Failed();
  }
  ~Handle() { close_(id_); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

void check(herr_t status) {
  if (status < 0) throw Failed();
}

Handle text_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  check(H5Tset_size(type, H5T_VARIABLE));
  check(H5Tset_cset(type, H5T_CSET_UTF8));
  return Handle(H5Tcopy(type), H5Tclose);
}

std::vector<const char*> pointers(const std::vector<std::string>& texts) {
  std::vector<const char*> out;
  for (const std::string& text : texts) out.push_back(text.c_str());
  return out;
}

/// Members in the order in which they were made.
Handle group(hid_t in, const char* name) {
  const Handle properties(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  check(H5Pset_link_creation_order(properties, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED));
  return Handle(H5Gcreate2(in, name, H5P_DEFAULT, properties, H5P_DEFAULT), H5Gclose);
}

/// Without the time at which it was made.
Handle dataset(hid_t in, const std::string& name, hid_t type, std::vector<hsize_t> sizes) {
  const Handle space(H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr), H5Sclose);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  check(H5Pset_obj_track_times(properties, false));
  return Handle(H5Dcreate2(in, name.c_str(), type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose);
}

void write_numbers(hid_t in, const std::string& name, const std::vector<double>& values,
                   std::vector<hsize_t> sizes) {
  const Handle set = dataset(in, name, H5T_IEEE_F64LE, std::move(sizes));
  check(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
}

void write_texts(hid_t in, const std::string& name, const std::vector<std::string>& texts) {
  const Handle type = text_type();
  const Handle set = dataset(in, name, type, {texts.size()});
  check(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers(texts).data()));
}

void write_attribute(hid_t of, const char* name, const std::vector<std::string>& texts) {
  const Handle type = text_type();
  const hsize_t size = texts.size();
  const Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  const Handle attribute(H5Acreate2(of, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  check(H5Awrite(attribute, type, pointers(texts).data()));
}

/// HDF5 takes a slash for a group: `grasp_slip[m per s]`.
std::string link_name(std::string name) {
  for (std::size_t at = 0; (at = name.find('/', at)) != std::string::npos;) name.replace(at, 1, " per ");
  return name;
}

void write_column(hid_t in, const Table& table, std::size_t i) {
  Column column = table.head.columns[i];
  column.name = link_name(column.name);
  if (column.text) {
    std::vector<std::string> texts;
    for (const RolloutRow& row : table.rows) {
      const auto* text = std::get_if<std::string>(&row.cells[i]);
      texts.push_back(text ? *text : "");
    }
    return write_texts(in, column.name, texts);
  }
  std::vector<double> numbers;
  for (const RolloutRow& row : table.rows) {
    const double* number = std::get_if<double>(&row.cells[i]);
    numbers.push_back(number ? *number : std::numeric_limits<double>::quiet_NaN());
  }
  write_numbers(in, column.name, numbers, {numbers.size()});
}

/// The file as it would be on the disk. HDF5 never writes to the disk itself: after a write that fails, as on
/// a full disk, it ends the process when the file is closed.
std::string image_of(const Table& table) {
  constexpr std::size_t kGrowth = std::size_t{1} << 22U;
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  check(H5Pset_fapl_core(access, kGrowth, false));
  const Handle file(H5Fcreate("rollouts.h5", H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
  write_attribute(file, "title", {table.head.title});
  write_attribute(file, "seed", {table.head.seed});
  write_attribute(file, "origin", table.head.origin);
  {
    const Handle rollouts = group(file, "rollouts");
    for (std::size_t i = 0; i < table.head.columns.size(); ++i) write_column(rollouts, table, i);
  }
  {
    const Handle trajectories = group(file, "trajectories");
    for (const RolloutRow& row : table.rows) {
      if (!row.trajectory || row.trajectory->columns.empty()) continue;
      const hsize_t width = row.trajectory->columns.size();
      const std::string name = std::to_string(row.rollout);
      write_numbers(trajectories, name, row.trajectory->values,
                    {row.trajectory->values.size() / width, width});
      // A head of many names is too large for an attribute: a dataset beside it.
      write_texts(trajectories, name + ".columns", row.trajectory->columns);
    }
  }
  check(H5Fflush(file, H5F_SCOPE_GLOBAL));
  std::string out(static_cast<std::size_t>(std::max<ssize_t>(H5Fget_file_image(file, nullptr, 0), 0)), '\0');
  if (out.empty() || H5Fget_file_image(file, out.data(), out.size()) < 0) throw Failed();
  return out;
}

}  // namespace

void write_hdf5(const Table& table, const std::filesystem::path& path) {
  check(H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr));
  std::string image;
  try {
    image = image_of(table);
  } catch (const Failed&) {
    throw output_error(path.string(), "a table that HDF5 refuses", "fewer rollouts, or more memory");
  }
  output::write_file(path, image);
}

}  // namespace handsim::study
