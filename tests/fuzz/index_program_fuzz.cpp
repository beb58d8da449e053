// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Programs of insertions, erasures, queries, savings and loadings of a growing index, read from the bytes,
// against a std::map and loops in long double. What is refused, by an Error or by a violation handler that
// throws, must leave the index as it was.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <sstream>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/tree_file.hpp>

namespace {

void require(bool condition, const char* sentence) {
  if (condition) return;
  std::fprintf(stderr, "index_program_fuzz: %s\n", sentence);
  std::abort();
}

struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Whether a call is refused.
template <class Call>
bool is_refused(Call&& call) {
  const auto previous = cairn::set_violation_handler(
      [](const cairn::Violation& violation) { throw Refused(violation.sentence); });
  bool refused = false;
  try {
    call();
  } catch (const cairn::Error&) {
    refused = true;
  } catch (const Refused&) {
    refused = true;
  }
  cairn::set_violation_handler(previous);
  return refused;
}

class Bytes {
public:
  Bytes(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}
  [[nodiscard]] bool empty() const { return rest_.empty(); }
  std::uint8_t next() {
    if (rest_.empty()) return 0;
    const std::uint8_t byte = rest_.front();
    rest_ = rest_.subspan(1);
    return byte;
  }
  template <class Number>
  Number raw() {
    std::array<std::uint8_t, sizeof(Number)> bytes{};
    for (std::uint8_t& byte : bytes) byte = next();
    return std::bit_cast<Number>(bytes);
  }

private:
  std::span<const std::uint8_t> rest_;
};

/// The machine: an index, what it must hold, and what the bytes do to both.
template <class Scalar, std::size_t Dim>
class Machine {
public:
  using Index = cairn::MultiKdTree<Scalar, Dim>;
  using Tree = cairn::KdTree<Scalar, Dim>;
  using Real = typename Index::Real;
  using Row = std::vector<Scalar>;

  Machine(Bytes bytes, std::size_t dim) : bytes_(bytes), dim_(dim), index_(shape()) {}

  void run() {
    for (int step = 0; step < 60 && !bytes_.empty(); ++step) {
      switch (bytes_.next() % 10) {
        case 0:
        case 1:
          insert();
          break;
        case 2:
          insert_with_ids();
          break;
        case 3:
        case 4:
          erase();
          break;
        case 5:
          index_.rebuild();
          require(index_.tree_count() == (points_.empty() ? 0U : 1U), "a rebuilt index is one tree");
          break;
        case 6:
          index_.finish_merges();
          require(index_.merges_under_way() == 0, "a merge has not ended");
          break;
        case 7:
          save_and_load();
          break;
        case 8: {
          const Index copy = index_;
          index_ = copy;
          break;
        }
        default:
          break;
      }
      check();
    }
  }

private:
  cairn::MultiTreeShape shape() {
    const std::uint8_t byte = bytes_.next();
    return {.first_size = 1U + byte % 23U,
            .growth = 2U + byte / 23U % 3U,
            .rule = byte / 69U % 2U == 0 ? cairn::MergeRule::one_a_level : cairn::MergeRule::counter,
            .merging = byte / 138U == 0 ? cairn::Merging::at_once : cairn::Merging::spread};
  }

  /// A number of a lattice, any number near it, or any bits at all.
  double number() {
    const std::uint8_t kind = bytes_.next();
    if (kind < 160) return static_cast<double>(kind % 8);
    if (kind < 250) return static_cast<double>(bytes_.next()) / 16 - 4;
    if constexpr (sizeof(Real) == 4) return static_cast<double>(bytes_.raw<float>());
    return bytes_.raw<double>();
  }
  /// Whether it can be kept as it is, rounded to a float or not at all.
  static bool can_be_kept(double number) {
    if constexpr (std::is_floating_point_v<Scalar>)
      return std::isfinite(number) && std::abs(number) <= (sizeof(Scalar) == 4 ? 3e16 : 1e150);
    else
      return number >= std::numeric_limits<Scalar>::min() && number <= std::numeric_limits<Scalar>::max() &&
             number == std::floor(number);
  }

  struct Given {
    std::vector<std::vector<double>> points;
    bool good = true;
  };
  Given given(std::size_t count) {
    Given given;
    for (std::size_t i = 0; i < count; ++i) {
      std::vector<double> point(dim_);
      for (double& coordinate : point) {
        coordinate = number();
        given.good = given.good && can_be_kept(coordinate);
      }
      given.points.push_back(std::move(point));
    }
    return given;
  }
  void keep(cairn::PointId id, const std::vector<double>& point) {
    Row row;
    for (const double coordinate : point) row.push_back(static_cast<Scalar>(coordinate));
    points_[id] = std::move(row);
    taken_.insert(id);
  }

  void insert() {
    const Given given = this->given(bytes_.next() % 24U);
    const cairn::PointId expected = taken_.empty() ? 0 : *taken_.rbegin() + 1;
    cairn::PointId first = 0;
    const bool refused = is_refused([&] { first = index_.insert(given.points); });
    require(refused == !given.good, "points were refused for nothing, or taken in spite of what they are");
    if (refused) return;
    require(first == expected, "an insertion begins with another number than the next");
    for (std::size_t i = 0; i < given.points.size(); ++i)
      keep(first + static_cast<cairn::PointId>(i), given.points[i]);
  }

  void insert_with_ids() {
    const Given given = this->given(bytes_.next() % 8U);
    std::vector<cairn::PointId> ids;
    bool good = given.good;
    std::set<cairn::PointId> here;
    for (std::size_t i = 0; i < given.points.size(); ++i) {
      const std::uint8_t byte = bytes_.next();
      ids.push_back(byte == 255 ? cairn::no_point : cairn::PointId{byte} * (byte % 7U + 1U));
      good = good && ids.back() != cairn::no_point && !taken_.contains(ids.back()) &&
             here.insert(ids.back()).second;
    }
    const bool refused = is_refused([&] { index_.insert(given.points, ids); });
    require(refused == !good, "ids were refused for nothing, or taken in spite of what they are");
    if (refused) return;
    for (std::size_t i = 0; i < ids.size(); ++i) keep(ids[i], given.points[i]);
  }

  void erase() {
    const unsigned count = bytes_.next() % 16U;
    for (unsigned i = 0; i < count; ++i) {
      cairn::PointId id = bytes_.next();
      if (id % 2 == 0 && !points_.empty()) {  // one that is there
        auto at = points_.begin();
        std::advance(at, static_cast<std::ptrdiff_t>(id % points_.size()));
        id = at->first;
      }
      require(index_.erase(id) == (points_.erase(id) == 1), "an erasure says otherwise than the list");
    }
  }

  /// All points go into a file and come back under their numbers; then the index is made of them anew.
  void save_and_load() {
    std::vector<Row> rows;
    std::vector<cairn::PointId> ids;
    index_.for_each([&](cairn::PointId id, std::span<const Scalar> row) {
      ids.push_back(id);
      rows.emplace_back(row.begin(), row.end());
    });
    std::stringstream file;
    cairn::save_tree(file, Tree(rows, ids));
    const Tree loaded = cairn::load_tree<Tree>(file, "file");
    require(loaded.size() == points_.size(), "a file holds another number of points");
    if (loaded.empty()) return;
    Index made(index_.shape());
    rows.clear();
    ids.clear();
    loaded.for_each([&](cairn::PointId id, std::span<const Scalar> row) {
      ids.push_back(id);
      rows.emplace_back(row.begin(), row.end());
    });
    made.insert(rows, ids);
    index_ = std::move(made);
    taken_.clear();
    for (const auto& [id, row] : points_) taken_.insert(id);
  }

  [[nodiscard]] long double distance(const Row& row, const std::vector<Real>& query) const {
    long double sum = 0;
    for (std::size_t a = 0; a < dim_; ++a) {
      const long double difference = static_cast<long double>(row[a]) - static_cast<long double>(query[a]);
      sum += difference * difference;
    }
    return std::sqrt(sum);
  }
  /// Rounding, and squares that are too small for a Real.
  static bool same(Real found, long double expected) {
    const bool narrow = sizeof(Real) == 4;
    return std::abs(static_cast<long double>(found) - expected) <=
           (narrow ? 1e-5L : 1e-13L) * expected + (narrow ? 1e-18L : 1e-150L);
  }

  template <class Hits>
  void check_hits(const Hits& hits, const std::vector<Real>& query, const std::vector<long double>& sorted) {
    std::set<cairn::PointId> seen;
    for (std::size_t i = 0; i < hits.size(); ++i) {
      const auto at = points_.find(hits[i].id);
      require(at != points_.end(), "what was erased, or never there, is found");
      require(seen.insert(hits[i].id).second, "a point is found twice");
      require(i < sorted.size() && same(hits[i].distance, sorted[i]), "a distance is not that of its rank");
      require(same(hits[i].distance, distance(at->second, query)), "a distance is not that of its point");
    }
  }

  /// A query of any kind through every door.
  void check() {
    require(index_.size() == points_.size(), "the index has another size than the list");
    std::vector<Real> query(dim_), corner(dim_);
    bool good = true;
    for (Real& coordinate : query) {
      coordinate = static_cast<Real>(number());
      good = good && std::abs(coordinate) <= (sizeof(Real) == 4 ? Real(3e16) : Real(1e150));
    }
    const std::size_t k = bytes_.next() % 40U;
    // An index in which nothing ever was has no dimension and asks nothing of a query.
    if (!good) {
      const bool refused = is_refused([&] { static_cast<void>(index_.nearest(query, k + 1)); });
      require(refused || points_.empty(), "a query that is no point was answered");
      return;
    }
    std::vector<long double> sorted;
    for (const auto& [id, row] : points_) sorted.push_back(distance(row, query));
    std::sort(sorted.begin(), sorted.end());
    const auto hits = index_.nearest(query, k);
    require(hits.size() == std::min(k, points_.size()), "there are not as many nearest as asked for");
    check_hits(hits, query, sorted);
    check_budget(query, sorted, k);
    check_order(query, sorted);
    check_radius(query, sorted);
    for (Real& coordinate : corner) coordinate = static_cast<Real>(bytes_.next() % 9U);
    check_box(query, corner);
  }

  void check_budget(const std::vector<Real>& query, const std::vector<long double>& sorted, std::size_t k) {
    cairn::NearestTwo<Real> two;
    cairn::Work work;
    const std::size_t leaves = k % 2 == 0 ? k : 100000;
    const bool exact = search_.search(index_, query, two, {.leaves = leaves}, &work);
    require(work.leaves <= leaves && work.distances == 16 * work.leaves, "a budget was not kept");
    require(exact || leaves < 100000, "all leaves are not enough");
    std::vector<cairn::Neighbor<Real>> found;
    if (two.id() != cairn::no_point) found.push_back({two.id(), two.first()});
    if (two.second_id() != cairn::no_point) found.push_back({two.second_id(), two.second()});
    if (exact) {
      require(found.size() == std::min<std::size_t>(2, points_.size()), "the two nearest are missing");
      check_hits(found, query, sorted);
    }
    for (const auto& hit : found) {
      const auto at = points_.find(hit.id);
      require(at != points_.end() && same(hit.distance, distance(at->second, query)),
              "a budget brings back what was erased, or another distance");
    }
  }

  void check_order(const std::vector<Real>& query, const std::vector<long double>& sorted) {
    cairn::NearestFirst order(index_, query);
    std::vector<cairn::Neighbor<Real>> all;
    while (const auto hit = order.next()) {
      require(all.empty() || all.back().distance <= hit->distance, "nearest first is not in order");
      all.push_back(*hit);
      require(all.size() <= points_.size(), "nearest first does not end");
    }
    require(all.size() == points_.size(), "nearest first ends early");
    check_hits(all, query, sorted);
  }

  void check_radius(const std::vector<Real>& query, const std::vector<long double>& sorted) {
    const Real radius = static_cast<Real>(bytes_.next()) / 16;
    const auto hits = index_.within(query, radius);
    for (const auto& hit : hits) require(hit.distance <= radius, "within a radius is what is not");
    check_hits(hits, query, sorted);
    const long double surely = static_cast<long double>(radius) * (1 - 1e-5L) - 1e-17L;
    require(hits.size() >= static_cast<std::size_t>(std::upper_bound(sorted.begin(), sorted.end(), surely) -
                                                    sorted.begin()),
            "within a radius something is missing");
    if (hits.empty()) return;  // and what is reported at a distance is within it
    const auto again = index_.within(query, hits.back().distance);
    require(again.size() == hits.size(), "the farthest is not within its distance");
  }

  void check_box(const std::vector<Real>& low, const std::vector<Real>& high) {
    std::vector<cairn::PointId> expected, found = inside(index_, low, high);
    for (const auto& [id, row] : points_) {
      bool in = true;
      for (std::size_t a = 0; a < dim_; ++a) {
        const auto coordinate = static_cast<Real>(row[a]);
        in = in && low[a] <= coordinate && coordinate <= high[a];
      }
      if (in) expected.push_back(id);
    }
    std::sort(found.begin(), found.end());
    require(found == expected, "a box holds other points");
  }

  Bytes bytes_;
  std::size_t dim_;
  Index index_;
  cairn::BestBinFirst<Index> search_;
  std::map<cairn::PointId, Row> points_;
  std::set<cairn::PointId> taken_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const Bytes bytes(data + 1, size - 1);
  switch (data[0] % 5) {
    case 0:
      Machine<float, 2>(bytes, 2).run();
      break;
    case 1:
      Machine<double, cairn::dynamic_dim>(bytes, 3).run();
      break;
    case 2:
      Machine<float, cairn::dynamic_dim>(bytes, 10).run();
      break;
    case 3:
      Machine<std::uint8_t, 2>(bytes, 2).run();
      break;
    default:
      Machine<std::int16_t, 9>(bytes, 9).run();
  }
  return 0;
}
