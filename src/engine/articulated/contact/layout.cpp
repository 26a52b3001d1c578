// Where the contact solver has its numbers: trees, their chains, and the rows of A and of the factor.
#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <utility>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact/solver.h"

namespace handsim::engine::articulated {

void ContactNewton::resize(std::span<const int> first) {
  first_.assign(first.begin(), first.end());
  lay_out(first);
  loaded_.resize(at(n_));
  std::iota(loaded_.begin(), loaded_.end(), 0);
  reserve(*this, scratch().whole);
  if (std::count(tree_first_.begin(), tree_first_.end(), 0) == n_) return;
  part_ = std::make_unique<ContactNewton>(kernel_);
  part_->reserve(*this, scratch().part);
}

/// Sizes everything for some unknowns, where they are not those of the last problem. @param whole null: they
/// are of those given to `resize`
bool ContactNewton::lay_out_some(std::span<const int> unknowns, const ContactNewton* whole) {
  const std::span<const int> first = whole ? whole->A_first_ : first_;
  const auto id = [&](int i) { return whole ? whole->loaded_[at(i)] : i; };
  const auto same = [&](int unknown, int loaded) { return id(unknown) == loaded; };
  if (std::equal(unknowns.begin(), unknowns.end(), loaded_.begin(), loaded_.end(), same)) return false;
  loaded_.clear();
  own_first_.clear();
  for (const int i : unknowns) {
    // A tree's unknowns stay together.
    own_first_.push_back(static_cast<int>(loaded_.size()) - (i - first[at(i)]));
    loaded_.push_back(id(i));
  }
  lay_out(own_first_);
  return true;
}

bool ContactNewton::select(std::span<const int> unknowns) { return lay_out_some(unknowns, nullptr); }

/// Most unknowns that can move two bodies against each other.
std::size_t ContactNewton::widest() const {
  std::size_t deepest = 0;
  for (int i = 0; i < n_; ++i) {
    std::size_t depth = 0;
    for (int k = i; k < n_; k = parent_[at(k)]) ++depth;
    deepest = std::max(deepest, depth);
  }
  return std::min(at(n_), 2 * deepest);
}

/// Sizes everything for the unknowns; allocates only where there were never as many.
void ContactNewton::lay_out(std::span<const int> first) {
  n_ = static_cast<int>(first.size());
  A_first_.assign(first.begin(), first.end());
  A_last_.resize(at(n_));
  for (int i = 0; i < n_; ++i) {
    A_last_[at(i)] = i;
    for (int k = A_first_[at(i)]; k < i; ++k) A_last_[at(k)] = i;
  }
  A_size_ = lay_out_rows(A_last_, A_start_);
  find_chains();
  tree_first_.resize(at(n_));
  tree_last_.resize(at(n_));
  // A tree's unknowns stand together, its root's last.
  for (int i = 0; i < n_; ++i) tree_first_[at(i)] = A_first_[at(i)];
  for (int i = n_ - 1; i >= 0; --i) {
    tree_last_[at(i)] = i == n_ - 1 || tree_first_[at(i + 1)] > i ? i : tree_last_[at(i + 1)];
    if (i > 0 && tree_first_[at(i)] < i)
      tree_first_[at(i - 1)] = std::min(tree_first_[at(i - 1)], tree_first_[at(i)]);
  }
  trees_.clear();
  tree_of_.resize(at(n_));
  for (int i = 0; i < n_; ++i) {
    if (tree_first_[at(i)] == i) trees_.push_back({i, tree_last_[at(i)] + 1});
    tree_of_[at(i)] = static_cast<int>(trees_.size()) - 1;
  }
  structured_ = false;
}

void NewtonRoom::reserve(std::size_t n, std::size_t entries, std::size_t widest) {
  A_.reserve(entries);
  for (std::vector<double>* each : {&g_, &start_, &x_, &F_, &sum_, &d_, &Ad_}) each->reserve(n);
  bounds_.reserve(n);
  servos_.reserve(n);
  contacts_.reserve(kUsualContacts);
  pairs_.reserve(kUsualContacts);
  motions_.reserve(kSpatial * n);
  carried_.reserve(kSpatial * (n + 1));
  wrenches_.reserve(kUsualContacts * kUsualRows * kSpatial);
  dofs_.reserve(kUsualContacts * widest);
  for (std::vector<double>* each : {&r_, &s_}) each->reserve(kUsualContacts * kMostRows);
  dof_runs_.reserve(kUsualContacts * 4);
  columns_.reserve(kUsualContacts);
  column_range_.reserve(n);
  h_.reserve(kUsualContacts);
  layout_.reserve(n + kUsualContacts * (3 + widest));
  links_.reserve(n * (n / 64 + 1));
}

/// Member by member: std::swap of the whole takes 2 % of a step with contacts.
void NewtonRoom::swap(NewtonRoom& other) {
  const auto each = [&](auto... members) { ((this->*members).swap(other.*members), ...); };
  each(&NewtonRoom::A_, &NewtonRoom::g_, &NewtonRoom::start_, &NewtonRoom::x_, &NewtonRoom::F_,
       &NewtonRoom::sum_, &NewtonRoom::d_, &NewtonRoom::Ad_, &NewtonRoom::bounds_, &NewtonRoom::servos_,
       &NewtonRoom::contacts_, &NewtonRoom::dofs_, &NewtonRoom::dof_runs_, &NewtonRoom::pairs_,
       &NewtonRoom::motions_, &NewtonRoom::wrenches_, &NewtonRoom::carried_, &NewtonRoom::J_, &NewtonRoom::r_,
       &NewtonRoom::s_, &NewtonRoom::columns_, &NewtonRoom::column_range_, &NewtonRoom::h_,
       &NewtonRoom::layout_, &NewtonRoom::links_);
}

/// What is kept from problem to problem, of a solver's unknowns; and the room of the thread.
void ContactNewton::reserve(const ContactNewton& like, NewtonRoom& room) {
  const std::size_t n = at(like.n_), chains = like.chains_.size(), widest = like.widest();
  for (std::vector<int>* each : {&island_of_tree_, &tree_of_, &place_, &members_, &A_first_, &A_last_, &last_,
                                 &parent_, &tree_first_, &tree_last_, &loaded_, &own_first_})
    each->reserve(n);
  trees_.reserve(n);
  touching_.reserve(kUsualContacts);
  for (std::vector<int>* each : {&first_member_, &first_touching_, &next_}) each->reserve(n + 1);
  M_.reserve(std::min(n, at(kHeap)) * (std::min(n, at(kHeap)) + 1) / 2);
  for (std::vector<std::size_t>* each : {&A_start_, &M_start_, &chain_of_}) each->reserve(n);
  chains_.reserve(n);
  runs_.reserve(chains * chains);
  for (std::vector<double>* each : {&C_, &G_}) each->reserve(kUsualSliding * n);
  K_.reserve(kUsualSliding * kUsualSliding);
  pivots_.reserve(kUsualSliding);
  laid_out_.reserve(n + kUsualContacts * (3 + widest));
  for (std::vector<int>* each : {&active_, &factored_}) each->reserve(n + kUsualContacts);
  room.reserve(n, like.A_size_, widest);
  Scratch& shared = scratch();
  for (Solution* each : {&shared.latest, &shared.best}) {
    each->x.reserve(n);
    each->bounds.reserve(n);
    each->servos.reserve(n);
    each->contacts.reserve(kUsualContacts);
  }
  shared.start.reserve(kUsualContacts);
  shared.J.reserve(kUsualContacts * kMostRows * widest);
}

/// Of a problem that begins; the room may be of another solver.
void ContactNewton::clear() {
  A_.assign(A_size_, 0.0);
  for (std::vector<double>* each : {&g_, &start_}) each->assign(at(n_), 0.0);
  for (std::vector<double>* each : {&x_, &F_, &sum_, &d_, &Ad_}) each->resize(at(n_));
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  bounds_.assign(at(n_), {-kInfinity, kInfinity, 0});
  servos_.assign(at(n_), {});
  motions_.assign(kSpatial * at(n_), 0.0);
  carried_.assign(kSpatial * at(n_ + 1), 0.0);
  contacts_.clear();
  dofs_.clear();
  dof_runs_.clear();
  pairs_.clear();
  wrenches_.clear();
  entries_ = own_entries_ = 0;
  jacobians_known_ = false;
}

/// Where the rows of an upper triangle start, each from its diagonal to its last entry. @returns their size
std::size_t ContactNewton::lay_out_rows(std::span<const int> last, std::vector<std::size_t>& start) const {
  start.resize(at(n_));
  std::size_t count = 0;
  for (int i = 0; i < n_; ++i) {
    start[at(i)] = count - at(i);  // entry (i, j) is at start + j
    count += at(last[at(i)] - i + 1);
  }
  return count;
}

/// The unknown above each in its tree, and unbranched pieces of trees.
void ContactNewton::find_chains() {
  parent_.assign(at(n_), n_);
  for (int k = n_ - 1; k >= 0; --k)
    for (int i = A_first_[at(k)]; i < k; ++i) parent_[at(i)] = k;
  chains_.clear();
  chain_of_.resize(at(n_));
  for (int i = 0; i < n_; ++i) {
    const bool goes_on = i > 0 && parent_[at(i - 1)] == i && A_first_[at(i - 1)] == A_first_[at(i)];
    if (!goes_on) chains_.push_back({.own = {i, i}});
    ++chains_.back().own.end;
    chain_of_[at(i)] = chains_.size() - 1;
  }
}

/// Finds the factor's pattern, where unknowns or contacts are not those of the last problem.
void ContactNewton::update_structure() {
  layout_.assign(loaded_.begin(), loaded_.end());
  for (const ContactRows& contact : contacts_) {
    layout_.push_back(static_cast<int>(contact.first_dof));
    layout_.push_back(static_cast<int>(contact.dof_count));
    layout_.push_back(static_cast<int>(contact.rows));
  }
  layout_.insert(layout_.end(), dofs_.begin(), dofs_.end());
  if (layout_ != laid_out_) {
    laid_out_.swap(layout_);
    factored_.clear();
    structured_ = false;
  }
  if (!std::exchange(structured_, true)) find_structure(contacts_);
}

/// The pattern of the factor of A and of what contacts add.
void ContactNewton::find_structure(std::span<const ContactRows> contacts) {
  const std::size_t count = chains_.size(), words = count / 64 + 1;
  links_.assign(count * words, 0);
  const auto link = [&](std::size_t from, std::size_t to) {
    links_[from * words + to / 64] |= std::uint64_t{1} << to % 64;
  };
  for (std::size_t c = 0; c < count; ++c)
    for (int up = parent_[at(chains_[c].own.end - 1)]; up < n_;
         up = parent_[at(chains_[chain_of_[at(up)]].own.end - 1)])
      link(c, chain_of_[at(up)]);
  std::size_t last_run = dof_runs_.size();
  for (const ContactRows& contact : contacts) {
    // Contacts of one pair have the same unknowns.
    if (std::exchange(last_run, contact.first_run) == contact.first_run) continue;
    const std::size_t first = chain_of_[at(runs(contact).front().first)];
    for (const Run& run : runs(contact))
      for (std::size_t c = chain_of_[at(run.first)]; c < count && chains_[c].own.first < run.end; ++c)
        if (c > first) link(first, c);
  }
  runs_.clear();
  last_.resize(at(n_));
  for (std::size_t c = 0; c < count; ++c) {
    Chain& chain = chains_[c];
    chain.first_run = runs_.size();
    chain.next = count;
    for (std::size_t word = c / 64; word < words; ++word)
      for (std::uint64_t bits = links_[c * words + word]; bits != 0; bits &= bits - 1) {
        const std::size_t to = 64 * word + static_cast<std::size_t>(std::countr_zero(bits));
        const Run& own = chains_[to].own;
        // Fill-in: the first of the later chains has entries in all others.
        if (chain.next == count)
          chain.next = to;
        else
          link(chain.next, to);
        if (runs_.size() > chain.first_run && runs_.back().end == own.first)
          runs_.back().end = own.end;
        else
          runs_.push_back(own);
      }
    chain.run_count = runs_.size() - chain.first_run;
    const int last = (chain.run_count > 0 ? runs_.back().end : chain.own.end) - 1;
    for (int i = chain.own.first; i < chain.own.end; ++i) last_[at(i)] = last;
  }
}

}  // namespace handsim::engine::articulated
