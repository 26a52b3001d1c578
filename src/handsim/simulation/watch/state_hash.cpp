#include "handsim/simulation/watch/state_hash.h"

#include <algorithm>
#include <bit>
#include <charconv>

#include <fmt/format.h>

#include "handsim/core/archive.h"
#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

static_assert(std::endian::native == std::endian::little,
              "the hash is of the numbers as they stand in memory: swap their bytes here");

void StateHash::add(const model::State& state, HashedParts parts) {
  constexpr std::size_t kPerBody = 13;
  numbers_.resize(1 + kPerBody * (state.bodies.size() - 1) +
                  state.activation.size() * (1U + parts.fibres + parts.bridges));
  double* to = numbers_.data();
  *to++ = state.time;
  for (std::size_t i = 1; i < state.bodies.size(); ++i) {
    const model::BodyState& body = state.bodies[i];
    for (const double value :
         {body.p.x(), body.p.y(), body.p.z(), body.q.w(), body.q.x(), body.q.y(), body.q.z(), body.v.x(),
          body.v.y(), body.v.z(), body.w.x(), body.w.y(), body.w.z()})
      *to++ = value;
  }
  to = std::ranges::copy(state.activation, to).out;
  if (parts.fibres) to = std::ranges::copy(state.fibre_length, to).out;
  if (parts.bridges) std::ranges::copy(state.bridge_stretch, to);
  value_ =
      hash_bytes({reinterpret_cast<const char*>(numbers_.data()), numbers_.size() * sizeof(double)}, value_);
}

RunHash::RunHash(const Watched& watched)
    : engine_(watched.engine),
      parts_{model::any_elastic(watched.scene.model.muscles),
             model::any_short_range(watched.scene.model.muscles)} {
  hash_.add(engine_.state(), parts_);
}

void RunHash::update(Step& step) {
  if (++steps_ % kHashEvery == 0) hash_.add(step.engine.state(), parts_);
}

void RunHash::save(ArchiveWriter& out) const {
  out(steps_);
  out.word(hash_.value());
}

void RunHash::restore(ArchiveReader& in, const model::State& /*state*/) {
  in(steps_);
  hash_.set(in.word());
}

std::uint64_t RunHash::value() const {
  StateHash all = hash_;
  if (steps_ % kHashEvery != 0) all.add(engine_.state(), parts_);
  return all.value();
}

void RunHash::add_summary(SummaryJson& out) const { out.json["state_hash"] = hash_text(value()); }

std::string hash_text(std::uint64_t hash) { return fmt::format("{:016x}", hash); }

std::optional<std::uint64_t> parse_hash(std::string_view text) {
  constexpr std::size_t kDigits = 16;
  std::uint64_t hash = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), hash, 16);
  if (text.size() != kDigits || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return hash;
}

}  // namespace handsim::simulation
