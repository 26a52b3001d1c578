#include "handsim/engine/pair_table.h"

namespace handsim::engine {

PairTable::PairTable(const model::Model& model)
    : groups_(model.groups.size()), table_(groups_ * groups_, kNever) {
  for (const model::ContactRule& rule : model.contact_rules) {
    const auto a = static_cast<std::size_t>(rule.group_a);
    const auto b = static_cast<std::size_t>(rule.group_b);
    table_[a * groups_ + b] = table_[b * groups_ + a] = rule.material;
  }
}

bool PairTable::meets_any(int group) const {
  for (int other = 0; other < static_cast<int>(groups_); ++other)
    if (meet(group, other)) return true;
  return false;
}

}  // namespace handsim::engine
