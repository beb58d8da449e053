// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "landmark_store.hpp"

#include <cstddef>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/index/landmark_store.hpp>

namespace stereo_slam {
namespace {

/// Bright and dark blobs never match: two classes.
unsigned label_of(std::int8_t sign) {
  return sign < 0 ? 0 : 1;
}

/// A store of the library behind the run-time interface.
template <cairn::LandmarkStore Store>
class StoreOf final : public LandmarkStore {
public:
  explicit StoreOf(const StoreOptions& options)
      : test_{static_cast<float>(options.ratio), static_cast<float>(options.max_distance)},
        budget_{options.leaves},
        store_({.probation = options.probation, .classes = 2, .shape = options.shape}) {}

  LandmarkId add(const Look& look) override { return store_.add(look.descriptor, label_of(look.sign)); }
  void sighted(LandmarkId id) override { store_.sighted(id); }
  void trust(LandmarkId id) override { store_.trust(id); }
  bool is_base(LandmarkId id) const override { return store_.is_base(id); }
  void merge(LandmarkId kept, LandmarkId twin) override { store_.merge(kept, twin); }
  void erase(LandmarkId id) override { static_cast<void>(store_.erase(id)); }
  std::vector<LandmarkId> advance() override { return store_.advance().expired; }

  std::vector<std::optional<StoreMatch>> match(std::span<const Look> looks, unsigned threads) const override {
    std::vector<float> descriptors;
    std::vector<unsigned> labels;
    descriptors.reserve(looks.size() * Store::dimension);
    for (const Look& look : looks) {
      descriptors.insert(descriptors.end(), look.descriptor.begin(), look.descriptor.end());
      labels.push_back(label_of(look.sign));
    }
    const auto found = store_.match_all(descriptors, labels, test_, budget_, threads);
    std::vector<std::optional<StoreMatch>> matches(found.size());
    for (std::size_t i = 0; i < found.size(); ++i)
      if (found[i]) matches[i] = StoreMatch{found[i]->id, found[i]->distance};
    return matches;
  }

private:
  cairn::RatioTest test_;
  cairn::Budget budget_;
  Store store_;
};

template <std::size_t Dimension>
std::unique_ptr<LandmarkStore> make_store(const StoreOptions& options) {
  if (options.kind == StoreKind::single)
    return std::make_unique<StoreOf<cairn::SingleTreeStore<Dimension>>>(options);
  return std::make_unique<StoreOf<cairn::MultiTreeStore<Dimension>>>(options);
}

}  // namespace

std::unique_ptr<LandmarkStore> make_landmark_store(const StoreOptions& options) {
  switch (options.dimension) {
    case 64:
      return make_store<64>(options);
#ifdef EXAMPLES_HAVE_OPENCV
    case 128:
      return make_store<128>(options);
    case 256:
      return make_store<256>(options);
#endif
    default:
      cairn::raise("landmark store: none was built for descriptors of " + std::to_string(options.dimension) +
                   " numbers");
  }
}

}  // namespace stereo_slam
