// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A belief that grows: one Gaussian over a list of blocks (poses, landmarks, biases) that come and go at run
/// time, with all their correlations.
///
/// EKF-SLAM, associations known:
/// ```cpp
/// cairn::JointGaussian<cairn::SE2, cairn::Vector<2>> belief;  // its blocks are poses and landmarks
/// const auto robot = belief.add(cairn::SE2(), cairn::Matrix<3>::Zero()).id;
/// const cairn::JointExtended filter{.gate = cairn::chi_square_quantile(0.999, 2)};  // joint_extended.hpp
/// std::map<int, cairn::BlockId<cairn::Vector<2>>> landmarks;
/// for (const Entry& entry : log) {
///   const auto moved = filter.predict(belief, cairn::Unicycle{}, dt, entry.control, robot);
///   if (moved != cairn::Status::accepted) return 1;
///   for (const auto& [name, z] : entry.sightings) {
///     if (const auto known = landmarks.find(name); known != landmarks.end())
///       used += filter.update(belief, sighting, z, robot, known->second).accepted() ? 1 : 0;
///     else
///       landmarks[name] = belief.augment(cairn::inverted(sighting), z, robot).id;
///   }
/// }
/// const cairn::SE2 pose = belief.mean(robot);
/// const cairn::Matrix<3, 2> both = belief.cross_covariance(robot, landmarks[3]);
/// ```
///
/// Stochastic cloning: `const auto then = belief.clone(robot).id;` keeps the pose of this moment, fully
/// correlated; a sensor of the motion since then names both; `belief.marginalise(then)` forgets it. A window
/// of keyframes is the same with more of them; commit() gives the window what a solver of its own found for a
/// few.
///
/// Truth of each block = retract(mean, d), and all d together are N(0, P). P is kept as its lower triangle:
/// for n numbers of all steps 4 n^2 bytes (double), up to twice that after growing, and a workspace of some
/// rows. What a step touches is read from and written to the rows of the blocks it names; the rest moves by
/// one pass.
///
/// Tangent spaces: P lives in those at the means. An update moves the means and keeps P as it is, which is
/// right to first order, as Extended does; with iterations > 1 it is carried over to the new ones, as there.
/// Groups step on the right, so a pose's numbers are seen from the pose itself; a block with another error
/// (on the left, in the world) is a type with manifold_traits of its own.
///
/// (R. Smith, M. Self, P. Cheeseman, "Estimating uncertain spatial relationships in robotics", 1990: the
/// stochastic map; S. Roumeliotis, J. Burdick, "Stochastic cloning", ICRA 2002; S. Schmidt, "Application of
/// state-space methods to navigation problems", Advances in Control Systems 3, 1966: considered blocks.)
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/joint_covariance.hpp>
#include <cairn/filter/detail/plain_matrix.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Names a block of any kind. It stays good while other blocks come and go, and in copies of the belief; once
/// its block is gone, and before it is given one, it is refused.
struct AnyBlockId {
  std::uint32_t slot = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t generation = 0;
  friend bool operator==(const AnyBlockId&, const AnyBlockId&) = default;
};

/// Names a block of kind X.
template <Manifold X>
struct BlockId : AnyBlockId {};

/// What became of a new block: its name, or why there is none.
template <Manifold X>
struct [[nodiscard]] AddedBlock {
  BlockId<X> id{};
  Status status = Status::accepted;
  [[nodiscard]] bool accepted() const noexcept { return status == Status::accepted; }
};

/// How a new block follows from known ones and a measurement:
/// ```cpp
/// struct Place {
///   using State = cairn::SE2;  // of the block it is seen from; Product<...> for several
///   using Measurement = cairn::Product<cairn::Vector<1>, cairn::SO2>;
///   using New = cairn::Vector<2>;
///   New initialise(const State& x, const Measurement& z) const;                // without noise
///   cairn::Matrix<2, 3> jacobian(const State& x, const Measurement& z) const;  // step of New by step of x
///   cairn::Matrix<2> noise(const State& x, const Measurement& z) const;        // of New if x were known
/// };
/// ```
/// inverted() of joint_extended.hpp makes one of a sensor.
template <class G>
concept InverseModel =
    Manifold<typename G::State> && Manifold<typename G::Measurement> && Manifold<typename G::New> &&
    requires(const G& g, const typename G::State& x, const typename G::Measurement& z) {
      { g.initialise(x, z) } -> std::convertible_to<typename G::New>;
      { g.jacobian(x, z) } -> std::convertible_to<JacobianOf<typename G::New, typename G::State>>;
      { g.noise(x, z) } -> std::convertible_to<CovarianceOf<typename G::New>>;
    };

namespace detail {

/// The state that one or several blocks make together.
template <Manifold... X>
struct StateOfBlocks {
  using type = Product<X...>;
  static type of(const X&... x) { return type(x...); }
};
template <Manifold X>
struct StateOfBlocks<X> {
  using type = X;
  static X of(const X& x) { return x; }
};

/// How steps move from the tangent space at x to that at x (+) d.
template <Manifold X>
[[nodiscard]] CovarianceOf<X> carried(const X& x, const Tangent<X>& d) {
  return numeric_jacobian([&](const Tangent<X>& e) -> X { return retract(x, e); }, d);
}

/// A model of State may speak of blocks X...: they are its state, or the parts of it in order.
template <class State, class... X>
concept SpeaksOf = std::same_as<State, typename StateOfBlocks<X...>::type>;

/// Ends in the sentence, which prints the model's State and what the named blocks make.
template <class State, class Named>
struct BlocksMakeState {
  static_assert(
      std::same_as<State, Named>,
      "cairn: the blocks that a call ends with are together the model's State: one of that kind, or for a "
      "Product one of each part in its order; a process's control stands before them. See "
      "BlocksMakeState<the "
      "State, what was named>");
};
/// False, after the sentence. For no block Product<> is printed.
template <class State, class... X>
inline constexpr bool explain_blocks =
    (static_cast<void>(sizeof(BlocksMakeState<State, typename StateOfBlocks<X...>::type>)), false);
/// What functions ask of the blocks they are given, not for asking whether a model may speak of them.
template <class State, class... X>
concept NamesAll = SpeaksOf<State, X...> || explain_blocks<State, X...>;

/// Where each block's numbers begin in a step of their common state.
template <class... X>
inline constexpr std::array<int, sizeof...(X)> block_offsets = [] {
  std::array<int, sizeof...(X)> offsets{};
  const int sizes[] = {dof<X>...};
  for (std::size_t i = 1; i < sizeof...(X); ++i) offsets[i] = offsets[i - 1] + sizes[i - 1];
  return offsets;
}();

}  // namespace detail

/// The belief over blocks of the given kinds. A plain value: copies are independent, ids serve both; what is
/// moved from is empty. Constant functions may be called from several threads at once.
template <Manifold... Kinds>
class JointGaussian {
  using First = std::tuple_element_t<0, std::tuple<Kinds...>>;
  static_assert(((cairn::dof<Kinds> != dynamic) && ...), "each kind of block has a fixed size");
  static_assert((std::is_same_v<ScalarOf<Kinds>, ScalarOf<First>> && ...),
                "all kinds of block have one number type");

  template <class X>
  static constexpr int kind_of = [] {
    const bool same[] = {std::is_same_v<X, Kinds>...};
    int found = -1;
    for (int i = static_cast<int>(sizeof...(Kinds)) - 1; i >= 0; --i)
      if (same[i]) found = i;
    return found;
  }();
  static_assert(
      [] {
        const int first[] = {kind_of<Kinds>...};
        for (int i = 0; i < static_cast<int>(sizeof...(Kinds)); ++i)
          if (first[i] != i) return false;
        return true;
      }(),
      "each kind of block is listed once");

public:
  using Scalar = ScalarOf<First>;

  /// X is one of the kinds of block.
  template <class X>
  static constexpr bool has_kind = kind_of<X> >= 0;

  // What there is.

  /// Number of blocks.
  [[nodiscard]] int size() const noexcept { return static_cast<int>(order_.size()); }
  [[nodiscard]] bool empty() const noexcept { return order_.empty(); }
  /// Numbers of a step of all blocks.
  [[nodiscard]] int dof() const noexcept { return dof_; }
  /// Numbers of a step of one block. The block is in the state.
  [[nodiscard]] int dof(AnyBlockId id) const { return sizes[expected(id).kind]; }
  /// All blocks, in the order in which they were added or that reorder() gave them.
  [[nodiscard]] std::span<const AnyBlockId> blocks() const noexcept { return order_; }
  [[nodiscard]] bool contains(AnyBlockId id) const noexcept { return find(id) != nullptr; }
  /// The id of a block of kind X; nothing where it is of another kind, or not in the state.
  template <Manifold X>
  [[nodiscard]] std::optional<BlockId<X>> as(AnyBlockId id) const {
    const Slot* const slot = find(id);
    if (slot == nullptr || slot->kind != kind_of<X>) return std::nullopt;
    return BlockId<X>{id};
  }
  /// Makes room for so many numbers, so that growing to them moves nothing.
  void reserve(int numbers) { core_.make_room(numbers); }
  /// Bytes of the covariance.
  [[nodiscard]] std::size_t bytes() const noexcept { return core_.rows().bytes(); }

  // What is believed. Blocks that are named are in the state (contains()); otherwise the violation handler is
  // called.

  template <Manifold X>
    requires has_kind<X>
  [[nodiscard]] const X& mean(BlockId<X> id) const {
    return means<X>().values[expected(id, kind_of<X>).place];
  }
  template <Manifold X>
    requires has_kind<X>
  [[nodiscard]] CovarianceOf<X> covariance(BlockId<X> id) const {
    return cross_covariance(id, id);
  }
  /// E[d_a d_b^T]. O(1).
  template <Manifold A, Manifold B>
    requires(has_kind<A> && has_kind<B>)
  [[nodiscard]] Matrix<cairn::dof<A>, cairn::dof<B>, Scalar> cross_covariance(BlockId<A> a,
                                                                              BlockId<B> b) const {
    const detail::RowRange rows = range(expected(a, kind_of<A>)), columns = range(expected(b, kind_of<B>));
    Matrix<cairn::dof<A>, cairn::dof<B>, Scalar> result;
    core_.read({&rows, 1}, {&columns, 1}, result.data());
    return result;
  }
  /// The belief of one block, or of several as the Product of their states. O(d^2).
  template <Manifold... X>
    requires(sizeof...(X) > 0 && (has_kind<X> && ...))
  [[nodiscard]] auto marginal(BlockId<X>... ids) const {
    using Named = detail::StateOfBlocks<X...>;
    const std::array<detail::RowRange, sizeof...(X)> ranges{range(expected(ids, kind_of<X>))...};
    CovarianceOf<typename Named::type> covariance;
    core_.read(ranges, ranges, covariance.data());
    return Gaussian<typename Named::type>{Named::of(mean(ids)...), covariance};
  }
  /// The covariance of some blocks, one after the other, or of all in their order. O(d^2).
  [[nodiscard]] Matrix<dynamic, dynamic, Scalar> covariance(std::span<const AnyBlockId> ids) const {
    std::vector<detail::RowRange> ranges;
    int count = 0;
    for (const AnyBlockId id : ids) {
      ranges.push_back(range(expected(id)));
      count += ranges.back().count;
    }
    Matrix<dynamic, dynamic, Scalar> result(count, count);
    core_.read(ranges, ranges, result.data());
    return result;
  }
  [[nodiscard]] Matrix<dynamic, dynamic, Scalar> covariance() const { return covariance(order_); }
  /// Normalised estimation error squared of some blocks: `error` holds local(mean, truth) of each, one after
  /// the other. For blocks known at compile time nees(marginal(a, b), truth) does it. O(d^3).
  [[nodiscard]] Scalar nees(std::span<const AnyBlockId> ids, const Vector<dynamic, Scalar>& error) const {
    const Matrix<dynamic, dynamic, Scalar> p = covariance(ids);
    CAIRN_EXPECTS(error.size() == p.rows(), "nees: an error has as many numbers as a step of the blocks");
    return detail::squared_mahalanobis<dynamic, Scalar>(error, p);
  }

  // Blocks come.

  /// A block that is independent of all others. `covariance` may be singular. Refused: a mean or covariance
  /// that is not finite, or no covariance. O(n).
  template <Manifold X, class A>
    requires has_kind<X>
  AddedBlock<X> add(const X& mean, const A& covariance) {
    constexpr int d = cairn::dof<X>;
    Matrix<d, d, Scalar> p;
    if (!detail::to_plain<d, d, Scalar>(covariance, d, d, p)) return {{}, Status::size_mismatch};
    if (const Status status = check(mean, p); status != Status::accepted) return {{}, status};
    if (!core_.extend({}, d, p.data())) return {{}, not_extended()};
    make_room<X>();
    return {enlist(mean, core_.write_extension(d)), Status::accepted};
  }
  template <Manifold X>
  AddedBlock<X> add(const Gaussian<X>& belief) {
    return add(belief.mean, belief.covariance);
  }

  /// A block that follows from known ones, with its correlations: P_new,: = G P_known,: and
  /// P_new,new = G P_known,known G^T + Q for G the model's jacobian and Q its noise. O(n d^2).
  template <InverseModel G, Manifold... X>
    requires(has_kind<typename G::New> && (has_kind<X> && ...) && detail::NamesAll<typename G::State, X...>)
  AddedBlock<typename G::New> augment(const G& model, const typename G::Measurement& z, BlockId<X>... ids) {
    using New = typename G::New;
    using Named = detail::StateOfBlocks<X...>;
    constexpr int d = cairn::dof<New>;
    constexpr int known = cairn::dof<typename G::State>;
    if (!(has(ids) && ...)) return {{}, Status::unknown_block};
    const typename G::State x = Named::of(mean(ids)...);
    Matrix<d, known, Scalar> g;
    Matrix<d, d, Scalar> q;
    New value = model.initialise(x, z);
    if (!detail::to_plain<d, known, Scalar>(model.jacobian(x, z), d, known, g) ||
        !detail::to_plain<d, d, Scalar>(model.noise(x, z), d, d, q))
      return {{}, Status::size_mismatch};
    if (const Status status = check(value, q); status != Status::accepted) return {{}, status};
    if (!core_.extend(parts<d, X...>(g, ids...), d, q.data())) return {{}, not_extended()};
    make_room<New>();
    return {enlist(value, core_.write_extension(d)), Status::accepted};
  }

  /// A second block that is the same as this one now, to the last bit: the two are fully correlated and part
  /// when one of them moves. O(n d).
  template <Manifold X>
    requires has_kind<X>
  AddedBlock<X> clone(BlockId<X> id) {
    constexpr int d = cairn::dof<X>;
    if (!has(id)) return {{}, Status::unknown_block};
    const Matrix<d, d, Scalar> one = Matrix<d, d, Scalar>::Identity(), none = Matrix<d, d, Scalar>::Zero();
    if (!core_.extend(parts<d, X>(one, id), d, none.data())) return {{}, not_extended()};
    make_room<X>();
    const X value = mean(id);
    return {enlist(value, core_.write_extension(d)), Status::accepted};
  }

  /// Gives all blocks this joint covariance, in the order of blocks(), in the tangent spaces at the means:
  /// for a state that comes from elsewhere, a file say. Refused: another size, numbers that are not finite,
  /// no covariance. O(n^3).
  Status set_covariance(const Matrix<dynamic, dynamic, Scalar>& p) {
    if (p.rows() != dof_ || p.cols() != dof_) return Status::size_mismatch;
    if (!all_finite(p)) return Status::not_finite;
    const Matrix<dynamic, dynamic, Scalar> symmetric = symmetrised(p);
    if (!detail::is_valid_covariance<dynamic, Scalar>(symmetric)) return Status::not_positive_definite;
    std::vector<int> row;
    row.reserve(static_cast<std::size_t>(dof_));
    for (const AnyBlockId id : order_) {
      const detail::RowRange rows = range(*find(id));
      for (int i = 0; i < rows.count; ++i) row.push_back(rows.first + i);
    }
    for (std::size_t i = 0; i < row.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j)
        core_.rows().row(std::max(row[i], row[j]))[std::min(row[i], row[j])] =
            symmetric(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    return Status::accepted;
  }

  // Blocks go, or take another order.

  /// Removes a block: what is left is the marginal of the others, unchanged. Its rows are used again by the
  /// next block that fits; gaps of more than a quarter of all rows are closed, O(n^2). Amortised O(n d).
  Status marginalise(AnyBlockId id) {
    const Slot* const slot = find(id);
    if (slot == nullptr) return Status::unknown_block;
    make_room_to_drop();
    core_.release(range(*slot));
    delist(id);
    if (core_.sparse()) close_gaps();
    return Status::accepted;
  }
  /// Several of them; none where one is not in the state or named twice.
  Status marginalise(std::span<const AnyBlockId> ids) {
    if (!distinct(ids)) return Status::unknown_block;
    const std::vector<AnyBlockId> gone(ids.begin(), ids.end());  // `ids` may be blocks()
    make_room_to_drop();
    for (const AnyBlockId id : gone) {
      core_.release(range(*find(id)));
      delist(id);
    }
    if (core_.sparse()) close_gaps();
    return Status::accepted;
  }

  /// Gives the blocks another order: that of blocks() and of covariance(). Each is named once. No number
  /// moves. O(size).
  Status reorder(std::span<const AnyBlockId> ids) {
    if (ids.size() != order_.size() || !distinct(ids)) return Status::unknown_block;
    order_ = std::vector<AnyBlockId>(ids.begin(), ids.end());
    return Status::accepted;
  }

  // Blocks become known.

  /// A considered block (Schmidt) keeps its mean and covariance in updates; only its correlations with others
  /// change, and others count on its uncertainty. For what cannot be estimated, or shall not cost its
  /// consistency: calibration, old keyframes.
  Status consider(AnyBlockId id, bool on = true) {
    const Slot* const slot = find(id);
    if (slot == nullptr) return Status::unknown_block;
    slots_[id.slot].considered = on;
    core_.consider(range(*slot), on);
    return Status::accepted;
  }
  [[nodiscard]] bool considered(AnyBlockId id) const { return expected(id).considered; }

  /// The belief, given that this block is exactly `value`: it keeps that, without variance, and all others
  /// learn from it (but the considered ones). The innovation is the step to the value; its nis is against the
  /// belief. Refused with not_positive_definite: a value that differs from the mean where the belief has no
  /// variance. O(n^2 d).
  template <Manifold X>
    requires has_kind<X>
  Innovation<cairn::dof<X>, Scalar> condition(BlockId<X> id, const X& value) {
    constexpr int d = cairn::dof<X>;
    Innovation<d, Scalar> innovation;
    if (!has(id)) {
      innovation.status = Status::unknown_block;
      return innovation;
    }
    innovation.residual = local(mean(id), value);
    innovation.covariance = covariance(id);
    if (!detail::finite_state(value) || !all_finite(innovation.residual)) {
      innovation.status = Status::not_finite;
      return innovation;
    }
    const detail::RowRange rows = range(*find(id));
    if (!core_.learn({&rows, 1}, innovation.residual.data(), nullptr, 0, innovation.nis)) {
      innovation.status = Status::not_positive_definite;
      return innovation;
    }
    write_learned();
    set_mean(id, value);
    return innovation;
  }

  /// What a solver of its own found for some blocks, for all: they move by `step` and get the covariance
  /// `posterior` (both of the blocks one after the other, in the tangent spaces at the means), and the others
  /// follow by their correlations (but the considered ones):
  ///   K = P_:s P_ss^-1,   step_: = K step,   P <- P - K (P_ss - posterior) K^T
  /// (the posterior may also be larger than P_ss, where no other block is considered). Refused: sizes,
  /// numbers that are not finite, a posterior that is no covariance, a step where P_ss has no variance, and,
  /// while others are considered, a posterior that is larger in any direction (not_positive_definite).
  /// O(n^2 d + d^3).
  Status commit(std::span<const AnyBlockId> ids, const Vector<dynamic, Scalar>& step,
                const Matrix<dynamic, dynamic, Scalar>& posterior) {
    const Status status = learn(ids, step, posterior, 0);
    if (status == Status::accepted) write_learned();
    return status;
  }
  /// The same with a new block at `mean`, whose numbers are the last of `posterior`; it may have none in
  /// `step`.
  template <Manifold X>
    requires has_kind<X>
  AddedBlock<X> commit(std::span<const AnyBlockId> ids, const Vector<dynamic, Scalar>& step,
                       const Matrix<dynamic, dynamic, Scalar>& posterior, const X& mean) {
    constexpr int d = cairn::dof<X>;
    if (!detail::finite_state(mean)) return {{}, Status::not_finite};
    if (const Status status = learn(ids, step, posterior, d); status != Status::accepted) return {{}, status};
    make_room<X>();
    write_learned();
    return {enlist(mean, core_.write_extension(d)), Status::accepted};
  }

private:
  friend struct JointExtended;
  template <class S>
  friend class StackedMeasurement;

  struct Slot {
    std::uint32_t generation = 1;
    int kind = -1;  // none: the slot is free
    std::size_t place = 0;
    int row = 0;
    bool considered = false;
  };
  template <class X>
  struct Means {
    std::vector<X> values;
    std::vector<std::uint32_t> slots;
  };
  static constexpr int sizes[] = {cairn::dof<Kinds>...};

  template <class X>
  [[nodiscard]] Means<X>& means() noexcept {
    return std::get<Means<X>>(means_);
  }
  template <class X>
  [[nodiscard]] const Means<X>& means() const noexcept {
    return std::get<Means<X>>(means_);
  }

  [[nodiscard]] const Slot* find(AnyBlockId id) const noexcept {
    if (id.slot >= slots_.size()) return nullptr;
    const Slot& slot = slots_[id.slot];
    return slot.kind >= 0 && slot.generation == id.generation ? &slot : nullptr;
  }
  template <class X>
  [[nodiscard]] bool has(BlockId<X> id) const noexcept {
    const Slot* const slot = find(id);
    return slot != nullptr && slot->kind == kind_of<X>;
  }
  [[nodiscard]] const Slot& expected(AnyBlockId id) const {
    const Slot* const slot = find(id);
    CAIRN_EXPECTS(slot != nullptr, "a block that is named is in the state");
    return *slot;
  }
  [[nodiscard]] const Slot& expected(AnyBlockId id, int kind) const {
    const Slot& slot = expected(id);
    CAIRN_EXPECTS(slot.kind == kind, "a block that is named is of the kind that its id says");
    return slot;
  }
  [[nodiscard]] detail::RowRange range(const Slot& slot) const { return {slot.row, sizes[slot.kind]}; }
  [[nodiscard]] bool distinct(std::span<const AnyBlockId> ids) const {
    std::vector<bool> seen(slots_.size());
    for (const AnyBlockId id : ids) {
      if (find(id) == nullptr || seen[id.slot]) return false;
      seen[id.slot] = true;
    }
    return true;
  }

  template <class X>
  [[nodiscard]] static Status check(const X& mean, const CovarianceOf<X>& p) {
    if (!detail::finite_state(mean) || !all_finite(p)) return Status::not_finite;
    return detail::is_valid_covariance<cairn::dof<X>, Scalar>(p) ? Status::accepted
                                                                 : Status::not_positive_definite;
  }

  /// Why the covariance refuses new rows, or the move of others.
  [[nodiscard]] Status not_extended() const noexcept {
    return core_.is_finite() ? Status::not_positive_definite : Status::not_finite;
  }

  /// The columns of a Jacobian of Rows rows that belong to each of the blocks.
  template <int Rows, class... X, int R, int C>
  [[nodiscard]] std::array<detail::JacobianPart<Scalar>, sizeof...(X)> parts(
      const Matrix<R, C, Scalar>& jacobian, BlockId<X>... ids) const {
    const int rows = static_cast<int>(jacobian.rows());
    std::size_t next = 0;
    const auto part = [&](AnyBlockId id) {
      const Scalar* const from = jacobian.data() + rows * detail::block_offsets<X...>[next++];
      return detail::JacobianPart<Scalar>{range(*find(id)), 0, rows, from, rows};
    };
    return {part(ids)...};
  }

  /// What a copy has no room for.
  void make_room_to_drop() {
    detail::room_for(free_slots_, slots_.size());
    core_.make_room(core_.size());
  }
  /// For one more block of kind X, so that enlist() cannot fail.
  template <class X>
  void make_room() {
    detail::room_for(slots_, slots_.size() + 1);
    detail::room_for(order_, order_.size() + 1);
    detail::room_for(means<X>().values, means<X>().values.size() + 1);
    detail::room_for(means<X>().slots, means<X>().slots.size() + 1);
  }
  template <class X>
  [[nodiscard]] BlockId<X> enlist(const X& value, int row) {
    AnyBlockId id;
    if (free_slots_.empty()) {
      id = {static_cast<std::uint32_t>(slots_.size()), 1};
      slots_.emplace_back();
    } else {
      id = {free_slots_.back(), slots_[free_slots_.back()].generation};
      free_slots_.pop_back();
    }
    Means<X>& kind = means<X>();
    slots_[id.slot] = {id.generation, kind_of<X>, kind.values.size(), row, false};
    kind.values.push_back(value);
    kind.slots.push_back(id.slot);
    order_.push_back(id);
    dof_ += cairn::dof<X>;
    return {id};
  }
  void delist(AnyBlockId id) {
    Slot& slot = slots_[id.slot];
    dof_ -= sizes[slot.kind];
    const auto drop = [&]<class X>(Means<X>& kind) {
      if (slot.kind != kind_of<X>) return;
      kind.values[slot.place] = kind.values.back();
      kind.slots[slot.place] = kind.slots.back();
      slots_[kind.slots[slot.place]].place = slot.place;
      kind.values.pop_back();
      kind.slots.pop_back();
    };
    (drop(means<Kinds>()), ...);
    slot.kind = -1;
    if (++slot.generation != 0) free_slots_.push_back(id.slot);  // after 2^32 blocks a slot is given up
    order_.erase(std::find(order_.begin(), order_.end(), id));
  }
  void close_gaps() {
    const std::vector<int>& moved = core_.compact();
    for (Slot& slot : slots_)
      if (slot.kind >= 0) slot.row = moved[static_cast<std::size_t>(slot.row)];
  }

  /// Every mean by its part of a step of all rows.
  void move(const Scalar* step) {
    const auto move_kind = [&]<class X>(Means<X>& kind) {
      for (std::size_t i = 0; i < kind.values.size(); ++i) {
        const Scalar* const from = step + slots_[kind.slots[i]].row;
        Tangent<X> d;
        for (int k = 0; k < cairn::dof<X>; ++k) d(k) = from[k];
        kind.values[i] = manifold_traits<X>::retract(kind.values[i], d);
      }
    };
    (move_kind(means<Kinds>()), ...);
  }

  template <class X>
  void set_mean(BlockId<X> id, const X& value) {
    means<X>().values[find(id)->place] = value;
  }
  /// The same, and P from the old tangent spaces to the new ones: numbers of vectors stay, a group's are
  /// turned by the derivative of the step that is seen from the new mean.
  void move_and_carry(const Scalar* step) {
    const auto carry = [&]<class X>(const Means<X>& kind) {
      if constexpr (!detail::is_vector<X>)
        for (std::size_t i = 0; i < kind.values.size(); ++i) {
          const int row = slots_[kind.slots[i]].row;
          Tangent<X> d;
          bool moves = false;
          for (int k = 0; k < cairn::dof<X>; ++k) {
            d(k) = step[row + k];
            moves = moves || d(k) != Scalar(0);
          }
          if (!moves) continue;
          const CovarianceOf<X> by = detail::carried(kind.values[i], d);
          core_.rows().template turn<cairn::dof<X>>(row, by.data());
        }
    };
    (carry(means<Kinds>()), ...);
    move(step);
  }

  [[nodiscard]] Status learn(std::span<const AnyBlockId> ids, const Vector<dynamic, Scalar>& step,
                             const Matrix<dynamic, dynamic, Scalar>& posterior, int added) {
    if (!distinct(ids)) return Status::unknown_block;
    std::vector<detail::RowRange> ranges;
    int count = 0;
    for (const AnyBlockId id : ids) {
      ranges.push_back(range(*find(id)));
      count += ranges.back().count;
    }
    if (step.size() != count || posterior.rows() != count + added || posterior.cols() != count + added)
      return Status::size_mismatch;
    if (!all_finite(step) || !all_finite(posterior)) return Status::not_finite;
    const Matrix<dynamic, dynamic, Scalar> symmetric = symmetrised(posterior);
    if (!detail::is_valid_covariance<dynamic, Scalar>(symmetric)) return Status::not_positive_definite;
    Scalar squared(0);
    return core_.learn(ranges, step.data(), symmetric.data(), added, squared) ? Status::accepted
                                                                              : Status::not_positive_definite;
  }
  void write_learned() {
    core_.write_learned();
    move(core_.step());
  }

  detail::JointCovariance<Scalar> core_;
  std::tuple<Means<Kinds>...> means_;
  std::vector<Slot> slots_;
  std::vector<std::uint32_t> free_slots_;
  std::vector<AnyBlockId> order_;
  ResetOnMove<int> dof_;
};

}}  // namespace cairn::CAIRN_ABI
