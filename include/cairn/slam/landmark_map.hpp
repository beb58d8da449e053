// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// FastSLAM: landmarks as the map of a particle, and the proposal that looks at them.
///
///   p(x_1:t, n_1:t, m | z, u) = p(x_1:t, n_1:t | z, u) prod_j p(m_j | x_1:t, n_1:t, z)
/// Given the path x and which landmark n each sighting is of, landmarks are independent Gaussians
/// (M. Montemerlo, S. Thrun, D. Koller, B. Wegbreit, "FastSLAM: a factored solution to the simultaneous
/// localization and mapping problem", AAAI 2002; "FastSLAM 2.0", IJCAI 2003). LandmarkMap is a ConditionalMap
/// for ConditionalFilter: with FromMotion it is FastSLAM 1.0, with FromLandmarks 2.0. Copies share what none
/// of them has changed: a particle is copied in O(1), a landmark updated in O(log n).
///
/// The sensor is a ConditionalMeasurement (rao_blackwell.hpp) that can do two things more:
///
/// ```cpp
/// struct RangeBearingOfPoint {
///   using State = cairn::SE2;  using Part = cairn::Vector<2>;
///   using Measurement = cairn::Product<cairn::Vector<1>, cairn::SO2>;  // range, bearing
///   Measurement predict(const State& x, const Part& m) const;
///   cairn::Matrix<2> part_jacobian(const State& x, const Part& m) const;
///   cairn::Matrix<2, 3> state_jacobian(const State& x, const Part& m) const;
///   cairn::Matrix<2> noise(const State& x, const Part& m) const;
///   Part initialise(const State& x, const Measurement& z) const;  // where a landmark seen as z is
///   double detection_probability(const State& x, const Part& m) const;  // optional: 0 out of view
///   double reach() const;                                               // optional: of the sensor
/// };
/// ```
///
/// A sensor whose report can only be predicted with the sighting at hand, such as the distances of a
/// segment's ends from a line (examples/line_slam), gives a model of that sighting: an ordinary sensor whose
/// Measurement is those numbers, and what they should be.
///   of(z)                 that model: predict, both Jacobians, noise of its own Measurement; measured()
///   in_reach(x, m)        optional, for landmarks without a place: whether it may be seen from here at all
///   may_be(x, z, m)       optional: a cheap first look at a candidate
///   determines(z)         optional: whether a landmark may begin with this sighting
///   note(m, x, z)         optional: changes what a landmark carries besides its Gaussian, after an update
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/assignment.hpp>
#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/shared_array.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/rao_blackwell.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/index/shared_kd_tree.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// What predicts a sighting, given it: the sensor itself, or what it makes of the sighting.
template <class L>
[[nodiscard]] decltype(auto) model_of(const L& sensor, const typename L::Measurement& z) {
  if constexpr (requires { sensor.of(z); })
    return sensor.of(z);
  else
    return (sensor);
}
template <class L>
using ModelOf = std::remove_cvref_t<decltype(model_of(std::declval<const L&>(),
                                                      std::declval<const typename L::Measurement&>()))>;
/// What is held against the prediction.
template <class L, class Model>
[[nodiscard]] typename Model::Measurement measured(const Model& model, const typename L::Measurement& z) {
  if constexpr (std::same_as<Model, L>)
    return z;
  else
    return model.measured();
}

template <class L>
concept SensorOfPoseAndPart =
    ConditionalMeasurement<L> && requires(const L& l, const typename L::State& x, const typename L::Part& m) {
      { l.state_jacobian(x, m) } -> detail::JacobianLike<typename L::Measurement, typename L::State>;
    };

}  // namespace detail

/// A sensor of landmarks: one sighting determines where its landmark is, given the pose.
template <class L>
concept LandmarkSensor =
    std::copyable<typename L::Measurement> && detail::SensorOfPoseAndPart<detail::ModelOf<L>> &&
    std::same_as<typename detail::ModelOf<L>::State, typename L::State> &&
    std::same_as<typename detail::ModelOf<L>::Part, typename L::Part> &&
    requires(const L& l, const typename L::State& x, const typename L::Measurement& z) {
      { l.initialise(x, z) } -> StateOf<typename L::Part>;
    };

/// What was seen, and of which landmark where the sensor knows (a bar code): any small number. That is then
/// the landmark's number in the map. Landmarks that begin without one take the number after the largest, and
/// an identity that comes later and is that number is taken for theirs: do not mix the two in such an order.
template <std::copyable Z>
struct LandmarkSighting {
  Z z;
  std::optional<std::uint32_t> identity{};
};

/// Which landmark a sighting is of, in a map: its number there, or one of these.
inline constexpr std::uint32_t new_landmark = 0xffffffffU;  ///< seen for the first time
inline constexpr std::uint32_t no_landmark = 0xfffffffeU;   ///< of nothing: clutter

/// One number for each sighting of an observation.
using Association = std::vector<std::uint32_t>;

/// How sightings without an identity find their landmarks; no two of an observation get the same.
enum class Pick {
  likeliest,  ///< of all assignments the one of the greatest likelihood
  drawn       ///< each particle draws its own, in proportion to the likelihood, one sighting after the other
};

struct LandmarkOptions {
  Pick pick = Pick::likeliest;
  double gate = 0.99;  ///< share of a landmark's sightings that are inside its gate
  /// The same for sightings with an identity; 1: what is said to be a landmark is taken for it, wherever.
  double gate_of_named = 1;
  /// Densities of a sighting that is of no landmark of the map, over the space of measurements: of one that
  /// is new, and of clutter. Sightings with an identity are never taken for new where it is known.
  double new_density = 1e-3;
  double clutter_density = 1e-4;
  double seen = 0.85;            ///< added to a landmark's log odds by a sighting, at least
  double false_share = 0.05;     ///< probability that what is no landmark is seen again
  double remove_below = -1;      ///< log odds; -infinity keeps all
  double most_log_odds = 8;      ///< what has been seen a thousand times can still go
  double filing_distance = 0.5;  ///< a landmark that moved by less stays where it is filed in the index

  [[nodiscard]] bool valid() const noexcept {
    const auto is_share = [](double v) { return v > 0 && v < 1; };
    return is_share(gate) && gate_of_named > 0 && gate_of_named <= 1 && is_share(false_share) &&
           new_density > 0 && clutter_density > 0 && seen >= 0 && remove_below < 0 && most_log_odds > 0 &&
           filing_distance > 0 && std::isfinite(new_density) && std::isfinite(clutter_density) &&
           std::isfinite(seen) && std::isfinite(filing_distance);
  }
};

/// A landmark of one particle.
template <Manifold M>
struct MappedLandmark {
  Gaussian<M> belief{};
  double log_odds = 0;          ///< of its being there at all
  std::uint32_t sightings = 0;  ///< 0: there is none of this number
};

/// All of a LandmarkMap but its sensor and options, as plain values: for files.
template <Manifold M>
struct LandmarkMapRecord {
  struct Landmark {
    std::uint32_t number = 0;
    MappedLandmark<M> landmark{};
    std::vector<double> filed{};  ///< where the index has it, which may lag behind; none without an index
  };
  std::vector<Landmark> landmarks{};  ///< that are there, by growing numbers
  std::uint32_t numbers = 0;          ///< one beyond the greatest that was ever given
  double widest = 0;                  ///< standard deviation of any landmark's place that was ever filed
};

namespace detail {

/// The sensor as an ordinary one of the pose, over a landmark that is as uncertain as believed:
/// noise H_m S H_m^T + R.
template <SensorOfPoseAndPart L>
struct SensorOfPose {
  using State = typename L::State;
  using Measurement = typename L::Measurement;
  const L& sensor;
  const Gaussian<typename L::Part>& landmark;
  [[nodiscard]] decltype(auto) predict(const State& x) const { return sensor.predict(x, landmark.mean); }
  [[nodiscard]] decltype(auto) jacobian(const State& x) const {
    return sensor.state_jacobian(x, landmark.mean);
  }
  [[nodiscard]] CovarianceOf<Measurement> noise(const State& x) const {
    const auto h = dense_of(sensor.part_jacobian(x, landmark.mean));
    const CovarianceOf<Measurement> r = dense_of(sensor.noise(x, landmark.mean));
    return symmetrised(CovarianceOf<Measurement>(h * landmark.covariance * h.transpose() + r));
  }
};

/// How many numbers a landmark has a place by: of vectors as many as they have, of others none.
template <class M>
inline constexpr int place_size = 0;
template <class S, int N, int Options, int MaxRows, int MaxColumns>
inline constexpr int place_size<Eigen::Matrix<S, N, 1, Options, MaxRows, MaxColumns>> =
    N > 0 && N <= 3 ? N : 0;

/// Where landmarks are, so that a sighting's candidates are found without looking at all. Each is filed at a
/// point, which may lag behind its mean; the widest standard deviation of all is an upper bound.
template <int D>
struct LandmarkPlaces {
  SharedKdTree<D> tree{};
  SharedArray<std::array<double, D>> filed{};
  double widest = 0;
};
template <>
struct LandmarkPlaces<0> {};

}  // namespace detail

/// The landmarks of one particle: ConditionalMap and ChoosingMap. Given which landmark a sighting is of, and
/// the pose, a landmark is updated by the extended Kalman filter. Landmarks of types other than vectors of up
/// to three numbers have no index: candidates are then all of them that the sensor does not rule out. `F` is
/// the filter of a landmark: Extended, Unscented, or another that updates a Gaussian.
template <LandmarkSensor L, class F = Extended>
class LandmarkMap {
public:
  using Sensor = L;
  using Pose = typename L::State;
  using Landmark = typename L::Part;
  using Measurement = typename L::Measurement;
  using Sighting = LandmarkSighting<Measurement>;
  using Observation = std::vector<Sighting>;
  using Choice = Association;

  /// Identities must be below this: they are places in an array.
  static constexpr std::uint32_t most_identity = 1U << 24U;

  /// An empty map. Throws Error where an option is out of its range.
  explicit LandmarkMap(L sensor = {}, const LandmarkOptions& options = {})
      : common_(std::make_shared<const Common>(Common{std::move(sensor), checked(options),
                                                      squared_gate(options.gate),
                                                      squared_gate(options.gate_of_named)})) {}

  [[nodiscard]] const L& sensor() const noexcept { return common_->sensor; }
  [[nodiscard]] const LandmarkOptions& options() const noexcept { return common_->options; }
  /// Of landmarks that are there.
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The landmark, or null where there is none of this number.
  [[nodiscard]] const MappedLandmark<Landmark>* find(std::uint32_t number) const noexcept {
    const MappedLandmark<Landmark>& found = landmarks_[number];
    return found.sightings == 0 ? nullptr : &found;
  }
  /// Calls visit(number, landmark) for all, by growing numbers.
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (std::uint32_t n = 0; n < landmarks_.size(); ++n)
      if (const auto* landmark = find(n)) visit(n, *landmark);
  }
  /// Nodes that changes of this map have copied because other maps held them. Of several maps that write to
  /// the same nodes on different threads it is not said which copies.
  [[nodiscard]] std::size_t node_copies() const noexcept {
    if constexpr (is_placed)
      return landmarks_.node_copies() + places_.tree.node_copies() + places_.filed.node_copies();
    else
      return landmarks_.node_copies();
  }

  /// What makes this map again. O(n).
  [[nodiscard]] LandmarkMapRecord<Landmark> record() const;
  /// The map that record() described, with this one's sensor and options: whatever it is asked or told, its
  /// answers are the same bits. O(n log n). Throws Error where numbers do not grow or a landmark is none: its
  /// mean not finite, its covariance none, never seen, filed too far from where it is.
  [[nodiscard]] LandmarkMap restored(const LandmarkMapRecord<Landmark>& record) const;

  /// Which landmarks these sightings are of, for a pose that may be uncertain: its mean, and covariances that
  /// it adds to what is predicted; a zero covariance is a pose that is known. The likelihood is the product
  /// of the sightings' own, each with the pose's uncertainty. Throws Error where a sighting is not finite or
  /// an identity too large.
  [[nodiscard]] Chosen<Choice> associate(const Gaussian<Pose>& x, const Observation& z, Random& random) const;

  /// What each of some sightings may be of, by the gates about one pose. To be asked again about another.
  class Candidates;
  [[nodiscard]] Candidates candidates(const Gaussian<Pose>& x, const Observation& z) const;
  /// Of the same candidates those inside their gates about this pose, with their densities there.
  [[nodiscard]] Candidates narrowed(const Candidates& candidates, const Gaussian<Pose>& x,
                                    const Observation& z) const;
  /// Of all assignments to candidates the likeliest.
  [[nodiscard]] Chosen<Choice> likeliest(const Candidates& candidates) const;

  /// The same at a known pose, with its likelihood: for FromMotion.
  [[nodiscard]] Chosen<Choice> choose(const Pose& x, const Observation& z, Random& random) const {
    return associate(known(x), z, random);
  }
  /// log p(z, n | x, m). A number that the map does not have is no_landmark.
  [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z, const Choice& n) const;
  /// log p(z, n | x, m) of the likeliest n.
  [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z) const {
    return likeliest(candidates(known(x), z)).log_likelihood;
  }
  /// log of the density of a sighting that is not of a landmark of the map.
  [[nodiscard]] double log_density_of(std::uint32_t not_a_landmark) const {
    return std::log(not_a_landmark == new_landmark ? options().new_density : options().clutter_density);
  }

  /// The squared Mahalanobis distance up to which a sighting may be of a landmark.
  [[nodiscard]] double gate_of(const Sighting& sighting) const noexcept {
    return sighting.identity ? common_->gate_of_named : common_->gate;
  }

  /// Takes the sightings in: updates, new landmarks, and the odds of what was not seen though in view. Throws
  /// Error, and has changed nothing, where an identity is too large; what is not finite is passed over, and
  /// so is a sighting of a number that the map does not have (any longer): clutter, as log_likelihood() has
  /// it. An observation without sightings changes nothing: it may be that nobody looked.
  void insert(const Pose& x, const Observation& z, const Choice& n);
  /// The same with the likeliest association at this pose.
  void insert(const Pose& x, const Observation& z) {
    insert(x, z, likeliest(candidates(known(x), z)).choice);
  }

private:
  using Model = detail::ModelOf<L>;  // of one sighting
  using Report = typename Model::Measurement;

  struct Common {
    L sensor;
    LandmarkOptions options;
    double gate, gate_of_named;  // of squared Mahalanobis distances
  };
  struct Candidate {
    std::uint32_t landmark = no_landmark;
    double log_density = 0;
  };
  /// What a sighting may be of: one of these or, where it has no name or that one is taken, something else.
  struct Alternatives {
    std::vector<Candidate> known{};
    Candidate otherwise{};
    bool is_named = false;
  };
  static constexpr int places = detail::place_size<Landmark>;
  static constexpr bool is_placed = places > 0;

  static LandmarkOptions checked(const LandmarkOptions& options) {
    if (!options.valid()) raise("LandmarkMap: expected options within their ranges");
    return options;
  }
  static double squared_gate(double share) {
    return share < 1 ? chi_square_quantile(share, dof<Report>) : std::numeric_limits<double>::infinity();
  }
  static Gaussian<Pose> known(const Pose& x) { return {x, CovarianceOf<Pose>::Zero(dof_of(x), dof_of(x))}; }

  void check(const Observation& z) const;
  static void check_identity(const Sighting& sighting) {
    if (sighting.identity && *sighting.identity >= most_identity)
      raise("LandmarkMap: expected identities below " + std::to_string(most_identity) + ", found " +
            std::to_string(*sighting.identity));
  }
  [[nodiscard]] bool begins(const Measurement& z) const {
    if constexpr (requires(const L& l) { l.determines(z); })
      return common_->sensor.determines(z);
    else
      return true;
  }
  [[nodiscard]] std::optional<Candidate> candidate(const Gaussian<Pose>& x, const Measurement& z,
                                                   std::uint32_t number, double gate) const;
  [[nodiscard]] std::vector<std::uint32_t> in_reach(const Pose& x) const;
  template <class Visit>
  void for_each_near(const Gaussian<Pose>& x, const Measurement& z, const std::vector<std::uint32_t>& near,
                     Visit&& visit) const;
  [[nodiscard]] static Chosen<Choice> drawn(const Candidates& candidates, Random& random);

  [[nodiscard]] std::optional<Gaussian<Landmark>> seen_first(const Pose& x, const Measurement& z) const;
  void update(const Pose& x, const Measurement& z, std::uint32_t number);
  std::optional<std::uint32_t> add(const Pose& x, const Sighting& sighting);
  void remove(std::uint32_t number);
  void miss(const Pose& x, const Choice& seen);
  [[nodiscard]] std::vector<std::uint32_t> in_view(const Pose& x) const;
  [[nodiscard]] double gained_odds(const Pose& x, const Landmark& m) const;
  [[nodiscard]] double certain_detection(const Pose& x, const Gaussian<Landmark>& landmark) const;
  void file(std::uint32_t number, bool is_new);
  void file_at(std::uint32_t number, const std::vector<double>& filed);

  std::shared_ptr<const Common> common_;
  SharedArray<MappedLandmark<Landmark>> landmarks_;
  [[no_unique_address]] detail::LandmarkPlaces<places> places_{};
  std::size_t size_ = 0;
};

template <LandmarkSensor L, class F>
class LandmarkMap<L, F>::Candidates {
public:
  [[nodiscard]] std::size_t size() const noexcept { return of.size(); }  ///< of the sightings
  /// Calls visit(landmark, log density) for the landmarks that a sighting may be of.
  template <class Visit>
  void for_each(std::size_t sighting, Visit&& visit) const {
    for (const Candidate& c : of[sighting].known) visit(c.landmark, c.log_density);
  }

private:
  friend class LandmarkMap<L, F>;
  std::vector<Alternatives> of{};
};

/// FastSLAM 2.0: the pose is drawn from what motion and sightings say of it together.
///
/// Starting at the motion, q takes in the sightings of known landmarks one after the other, the surest first,
/// by the extended Kalman filter; x is drawn from q, and
///   weight = p(x | motion) p(z, n | x, m) / q(x) / q(n)
/// is exact for whatever q is. The product of the innovations' densities on the way is the same number in the
/// linear case, and where it is not, has less variance and a bias (`evidence`). Densities are of the steps
/// from their means, whose volume differs from the group's by a share of angle^2 / 12.
struct FromLandmarks {
  enum class Weight { exact, evidence };
  Weight weight = Weight::exact;
  int iterations = 1;  ///< of each sighting's update, > 0: more where the sensor bends over the pose's spread
  /// How often it is chosen which landmarks the sightings are of: with the pose as the motion leaves it, then
  /// again with the pose as that choice makes it, which tells neighbours apart that the motion cannot.
  int associations = 1;  ///< > 0
  /// Above 0: the motion leaves more room than neighbours are apart. Candidates, those of sightings that have
  /// several first, are taken in alone, one after the other; each decides what the other sightings are of,
  /// and the decision under which all are likeliest together stays (after J. Civera, O. Grasa, A. Davison,
  /// J. Montiel, "1-point RANSAC for EKF filtering", IROS 2009, who count). It ends after so many in a row
  /// that led to nothing better. With Pick::drawn the probability of the choice is then no longer what is
  /// divided by.
  int hypotheses = 0;

  /// Throws Error where the motion's covariance is singular: then use FromMotion, or say how the wheels slip.
  template <LandmarkSensor L, class F>
  [[nodiscard]] ProposedOf<LandmarkMap<L, F>> operator()(const LandmarkMap<L, F>& map,
                                                         const Gaussian<typename L::State>& motion,
                                                         const typename LandmarkMap<L, F>::Observation& z,
                                                         Random& random) const {
    CAIRN_EXPECTS(iterations > 0 && associations > 0 && hypotheses >= 0,
                  "FromLandmarks updates and chooses once at least");
    const double log_volume = Cholesky<dof<typename L::State>>(motion.covariance).log_determinant();
    if (!std::isfinite(log_volume))
      raise(
          "FromLandmarks: expected a motion that is uncertain in every direction, found a singular "
          "covariance");
    auto best = hypotheses > 0 ? best_explained(motion, map, z)
                               : explained(motion, map, z, map.associate(motion, z, random));
    for (int again = 1; again < associations; ++again) {
      Chosen<Association> next = map.associate(best.q, z, random);
      if (next.choice == best.chosen.choice && map.options().pick == Pick::likeliest) break;
      best = explained(motion, map, z, std::move(next));
    }
    typename L::State x = sample(best.q, random);
    const double log_likelihood = map.log_likelihood(x, z, best.chosen.choice);
    const double log_weight = weight == Weight::evidence
                                  ? best.log_evidence
                                  : log_likelihood + log_density(motion, x) - log_density(best.q, x);
    return {std::move(x),
            std::move(best.q),
            log_weight - best.chosen.log_probability,
            log_likelihood,
            0,
            std::move(best.chosen.choice)};
  }

private:
  /// What the sightings are of, the pose after they are taken in, and how likely they are together.
  template <Manifold X>
  struct Explanation {
    Chosen<Association> chosen;
    Gaussian<X> q;
    double log_evidence = 0;
  };
  template <LandmarkSensor L, class F>
  [[nodiscard]] Explanation<typename L::State> explained(const Gaussian<typename L::State>& motion,
                                                         const LandmarkMap<L, F>& map,
                                                         const typename LandmarkMap<L, F>::Observation& z,
                                                         Chosen<Association> chosen) const {
    Explanation<typename L::State> result{std::move(chosen), motion};
    result.log_evidence = take_in(result.q, map, z, result.chosen.choice);
    return result;
  }

  /// A sighting as one of a landmark.
  struct Known {
    std::size_t sighting;
    std::uint32_t landmark;
    double log_volume;      // of the uncertainty of where the landmark is seen
    bool is_alone = false;  // the only candidate
  };
  /// Those that others may contradict first, then the surest.
  static void sort_surest_first(std::vector<Known>& known) {
    std::sort(known.begin(), known.end(), [](const Known& a, const Known& b) {
      return std::tie(a.is_alone, a.log_volume, a.sighting, a.landmark) <
             std::tie(b.is_alone, b.log_volume, b.sighting, b.landmark);
    });
  }
  template <LandmarkSensor L, class F>
  static Known as_known(const LandmarkMap<L, F>& map, const typename L::State& x,
                        const typename LandmarkMap<L, F>::Observation& z, std::size_t k, std::uint32_t n) {
    using Model = detail::ModelOf<L>;
    const auto& model = detail::model_of(map.sensor(), z[k].z);
    const detail::SensorOfPose<Model> sensor{model, map.find(n)->belief};
    return {k, n, Cholesky<dof<typename Model::Measurement>>(sensor.noise(x)).log_determinant()};
  }
  template <LandmarkSensor L, class F>
  [[nodiscard]] std::vector<Known> beginnings(const LandmarkMap<L, F>& map,
                                              const typename LandmarkMap<L, F>::Candidates& candidates,
                                              const typename L::State& x,
                                              const typename LandmarkMap<L, F>::Observation& z) const {
    std::vector<Known> all;
    for (std::size_t k = 0; k < z.size(); ++k) {
      const std::size_t first = all.size();
      candidates.for_each(k, [&](std::uint32_t n, double) { all.push_back(as_known(map, x, z, k, n)); });
      if (all.size() == first + 1) all.back().is_alone = true;
    }
    sort_surest_first(all);
    return all;
  }

  template <LandmarkSensor L, class F>
  [[nodiscard]] Explanation<typename L::State> best_explained(
      const Gaussian<typename L::State>& motion, const LandmarkMap<L, F>& map,
      const typename LandmarkMap<L, F>::Observation& z) const {
    using Model = detail::ModelOf<L>;
    const auto candidates = map.candidates(motion, z);
    auto best = explained(motion, map, z, map.likeliest(candidates));
    std::vector<Association> tried{best.chosen.choice};
    int in_vain = 0;
    for (const Known& each : beginnings(map, candidates, motion.mean, z)) {
      if (++in_vain > hypotheses) break;
      Gaussian<typename L::State> q = motion;
      const auto& model = detail::model_of(map.sensor(), z[each.sighting].z);
      const auto in = Extended{.iterations = iterations}.update(
          q, detail::SensorOfPose<Model>{model, map.find(each.landmark)->belief},
          detail::measured<L>(model, z[each.sighting].z));
      if (!in.accepted()) continue;
      Chosen<Association> chosen = map.likeliest(map.narrowed(candidates, q, z));
      if (std::find(tried.begin(), tried.end(), chosen.choice) != tried.end()) continue;
      tried.push_back(chosen.choice);
      auto next = explained(motion, map, z, std::move(chosen));
      if (!(next.log_evidence > best.log_evidence)) continue;
      best = std::move(next);
      in_vain = 0;
    }
    return best;
  }

  /// What lies outside its gate about the pose as the surer ones leave it is called clutter, but where the
  /// choice was drawn. Returns the sum of the innovations' log densities.
  template <LandmarkSensor L, class F>
  double take_in(Gaussian<typename L::State>& q, const LandmarkMap<L, F>& map,
                 const typename LandmarkMap<L, F>::Observation& z, Association& n) const {
    using Model = detail::ModelOf<L>;
    double log_evidence = 0;
    std::vector<Known> known;
    for (std::size_t k = 0; k < z.size(); ++k) {
      if (map.find(n[k]) == nullptr)
        log_evidence += map.log_density_of(n[k]);
      else
        known.push_back(as_known(map, q.mean, z, k, n[k]));
    }
    sort_surest_first(known);
    for (const Known& each : known) {
      const Extended filter{.gate = map.options().pick == Pick::likeliest
                                        ? map.gate_of(z[each.sighting])
                                        : std::numeric_limits<double>::infinity(),
                            .iterations = iterations};
      const auto& landmark = map.find(each.landmark)->belief;
      const auto& model = detail::model_of(map.sensor(), z[each.sighting].z);
      const auto in = filter.update(q, detail::SensorOfPose<Model>{model, landmark},
                                    detail::measured<L>(model, z[each.sighting].z));
      if (in.status == Status::gated) n[each.sighting] = no_landmark;
      if (in.accepted() || in.status == Status::gated)
        log_evidence += in.accepted() ? in.log_likelihood() : map.log_density_of(no_landmark);
    }
    return log_evidence;
  }
};

template <LandmarkSensor L, class F>
void LandmarkMap<L, F>::check(const Observation& z) const {
  for (std::size_t k = 0; k < z.size(); ++k) {
    if (!detail::finite_state(detail::measured<L>(detail::model_of(common_->sensor, z[k].z), z[k].z)))
      raise("LandmarkMap: expected sightings of finite numbers, found another: " + std::to_string(k));
    check_identity(z[k]);
  }
}

/// The sighting as one of this landmark; nothing where it lies outside the gate.
template <LandmarkSensor L, class F>
auto LandmarkMap<L, F>::candidate(const Gaussian<Pose>& x, const Measurement& z, std::uint32_t number,
                                  double gate) const -> std::optional<Candidate> {
  const Gaussian<Landmark>& belief = find(number)->belief;
  if constexpr (requires(const L& l) { l.may_be(x.mean, z, belief.mean); })
    if (!common_->sensor.may_be(x.mean, z, belief.mean)) return std::nullopt;
  const auto& model = detail::model_of(common_->sensor, z);
  const detail::SensorOfPose<Model> sensor{model, belief};
  const auto h = detail::dense_of(sensor.jacobian(x.mean));
  Innovation<dof<Report>, ScalarOf<Report>> in;
  in.residual = local(Report(sensor.predict(x.mean)), detail::measured<L>(model, z));
  in.covariance = symmetrised(CovarianceOf<Report>(h * x.covariance * h.transpose() + sensor.noise(x.mean)));
  const Cholesky<dof<Report>> root(in.covariance);
  if (!root.good()) return std::nullopt;
  in.nis = root.whiten(in.residual).squaredNorm();
  if (!(in.nis <= gate)) return std::nullopt;
  return Candidate{number, in.log_likelihood()};
}

template <LandmarkSensor L, class F>
auto LandmarkMap<L, F>::candidates(const Gaussian<Pose>& x, const Observation& z) const -> Candidates {
  check(z);
  Candidates all;
  all.of.resize(z.size());
  const std::vector<std::uint32_t> near = is_placed ? std::vector<std::uint32_t>{} : in_reach(x.mean);
  for (std::size_t k = 0; k < z.size(); ++k) {
    Alternatives& of = all.of[k];
    of.is_named = z[k].identity.has_value();
    const double gate = gate_of(z[k]);
    const auto add = [&](std::uint32_t number) {
      if (const auto found = candidate(x, z[k].z, number, gate)) of.known.push_back(*found);
    };
    const bool is_of_the_map = of.is_named && find(*z[k].identity) != nullptr;
    if (is_of_the_map)
      add(*z[k].identity);
    else if (!of.is_named)
      for_each_near(x, z[k].z, near, add);
    const bool is_new = !is_of_the_map && begins(z[k].z) &&
                        (of.is_named || options().new_density >= options().clutter_density);
    of.otherwise.landmark = is_new ? new_landmark : no_landmark;
    of.otherwise.log_density = log_density_of(of.otherwise.landmark);
    // Candidates come in the order of the index, which depends on its history.
    std::sort(of.known.begin(), of.known.end(),
              [](const Candidate& a, const Candidate& b) { return a.landmark < b.landmark; });
  }
  return all;
}

/// Landmarks without a place that the sensor does not rule out from here, whatever it sees.
template <LandmarkSensor L, class F>
std::vector<std::uint32_t> LandmarkMap<L, F>::in_reach(const Pose& x) const {
  std::vector<std::uint32_t> numbers;
  for_each([&](std::uint32_t number, const MappedLandmark<Landmark>& landmark) {
    if constexpr (requires(const L& l) { l.in_reach(x, landmark.belief.mean); })
      if (!common_->sensor.in_reach(x, landmark.belief.mean)) return;
    numbers.push_back(number);
  });
  return numbers;
}

/// Landmarks that a sighting from here may be of. Of a landmark inside the gate each number of its place
/// differs from the sighting's by no more than the gate's root times the sum of both standard deviations.
template <LandmarkSensor L, class F>
template <class Visit>
void LandmarkMap<L, F>::for_each_near(const Gaussian<Pose>& x, const Measurement& z,
                                      const std::vector<std::uint32_t>& near, Visit&& visit) const {
  if constexpr (!is_placed) {
    for (const std::uint32_t number : near) visit(number);
  } else {
    const Landmark place = common_->sensor.initialise(x.mean, z);
    const auto& model = detail::model_of(common_->sensor, z);
    const auto h_m = detail::dense_of(model.part_jacobian(x.mean, place));
    const auto h_x = detail::dense_of(model.state_jacobian(x.mean, place));
    const CovarianceOf<Report> r =
        h_x * x.covariance * h_x.transpose() + detail::dense_of(model.noise(x.mean, place));
    const Cholesky<dof<Report>> root(symmetrised(r));
    if (!root.good() || !all_finite(place)) return;
    const auto white = root.whiten(h_m);
    const Cholesky<places> information(symmetrised(CovarianceOf<Landmark>(white.transpose() * white)));
    if (!information.good()) return;
    const CovarianceOf<Landmark> spread = information.inverse();
    typename SharedKdTree<places>::Point low, high;
    for (int a = 0; a < places; ++a) {
      const double half =
          std::sqrt(common_->gate) * (std::sqrt(spread(a, a)) + places_.widest) + options().filing_distance;
      low[static_cast<std::size_t>(a)] = place(a) - half;
      high[static_cast<std::size_t>(a)] = place(a) + half;
    }
    places_.tree.for_each_in_box(low, high, [&](std::uint32_t number, const auto&) { visit(number); });
  }
}

template <LandmarkSensor L, class F>
auto LandmarkMap<L, F>::narrowed(const Candidates& candidates, const Gaussian<Pose>& x,
                                 const Observation& z) const -> Candidates {
  CAIRN_EXPECTS(candidates.of.size() == z.size(), "narrowed needs the sightings that the candidates are of");
  Candidates left = candidates;
  for (std::size_t k = 0; k < z.size(); ++k) {
    left.of[k].known.clear();
    for (const Candidate& c : candidates.of[k].known)
      if (const auto still = candidate(x, z[k].z, c.landmark, gate_of(z[k])))
        left.of[k].known.push_back(*still);
  }
  return left;
}

template <LandmarkSensor L, class F>
Chosen<Association> LandmarkMap<L, F>::likeliest(const Candidates& candidates) const {
  std::vector<std::uint32_t> columns;
  for (const Alternatives& of : candidates.of)
    for (const Candidate& c : of.known) columns.push_back(c.landmark);
  std::sort(columns.begin(), columns.end());
  columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  const std::size_t rows = candidates.of.size(), width = columns.size() + rows;
  std::vector<double> costs(rows * width, std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < rows; ++k) {
    for (const Candidate& c : candidates.of[k].known) {
      const auto at = std::lower_bound(columns.begin(), columns.end(), c.landmark);
      costs[k * width + static_cast<std::size_t>(at - columns.begin())] = -c.log_density;
    }
    constexpr double only_if_taken = 1e9;
    const bool has_name = candidates.of[k].is_named && !candidates.of[k].known.empty();
    costs[k * width + columns.size() + k] =
        has_name ? only_if_taken : -candidates.of[k].otherwise.log_density;
  }
  const auto assigned = best_assignment(costs, rows);
  Chosen<Association> result;
  for (std::size_t k = 0; k < rows; ++k) {
    const std::size_t column = (*assigned)[k];
    const bool is_known = column < columns.size();
    result.choice.push_back(is_known ? columns[column] : candidates.of[k].otherwise.landmark);
    result.log_likelihood += is_known ? -costs[k * width + column] : candidates.of[k].otherwise.log_density;
  }
  return result;
}

template <LandmarkSensor L, class F>
Chosen<Association> LandmarkMap<L, F>::drawn(const Candidates& candidates, Random& random) {
  Chosen<Association> result;
  const auto taken = [&](std::uint32_t landmark) {
    return std::find(result.choice.begin(), result.choice.end(), landmark) != result.choice.end();
  };
  for (const Alternatives& of : candidates.of) {
    std::vector<Candidate> free;
    for (const Candidate& c : of.known)
      if (!taken(c.landmark)) free.push_back(c);
    if (!of.is_named || free.empty()) free.push_back(of.otherwise);
    std::vector<double> log_densities;
    for (const Candidate& c : free) log_densities.push_back(c.log_density);
    const double total = log_sum_exp(log_densities);
    double left = random.uniform();
    std::size_t i = 0;
    while (i + 1 < free.size() && left >= std::exp(free[i].log_density - total))
      left -= std::exp(free[i++].log_density - total);
    result.choice.push_back(free[i].landmark);
    result.log_likelihood += free[i].log_density;
    result.log_probability += free[i].log_density - total;
  }
  return result;
}

template <LandmarkSensor L, class F>
Chosen<Association> LandmarkMap<L, F>::associate(const Gaussian<Pose>& x, const Observation& z,
                                                 Random& random) const {
  const Candidates all = candidates(x, z);
  return options().pick == Pick::drawn ? drawn(all, random) : likeliest(all);
}

template <LandmarkSensor L, class F>
double LandmarkMap<L, F>::log_likelihood(const Pose& x, const Observation& z, const Choice& n) const {
  CAIRN_EXPECTS(n.size() == z.size(), "log_likelihood needs one landmark for each sighting");
  double sum = 0;
  for (std::size_t k = 0; k < z.size(); ++k) {
    const auto* landmark = find(n[k]);
    if (landmark == nullptr) {
      sum += log_density_of(n[k]);
      continue;
    }
    const auto& model = detail::model_of(common_->sensor, z[k].z);
    const detail::SensorOfPose<Model> sensor{model, landmark->belief};
    const Gaussian<Report> expected{Report(sensor.predict(x)), sensor.noise(x)};
    sum += log_density(expected, detail::measured<L>(model, z[k].z));
  }
  return sum;
}

template <LandmarkSensor L, class F>
void LandmarkMap<L, F>::insert(const Pose& x, const Observation& z, const Choice& n) {
  CAIRN_EXPECTS(n.size() == z.size(), "insert needs one landmark for each sighting");
  for (const Sighting& sighting : z) check_identity(sighting);
  bool unnamed = false;
  Association seen;  // by the numbers that landmarks have now, which the new ones had not before
  for (std::size_t k = 0; k < z.size(); ++k) {
    unnamed = unnamed || !z[k].identity;
    if (n[k] == new_landmark) {
      if (const auto number = add(x, z[k])) seen.push_back(*number);
    } else if (find(n[k]) != nullptr) {
      update(x, z[k].z, n[k]);
      seen.push_back(n[k]);
    }
  }
  if (unnamed) miss(x, seen);
}

template <LandmarkSensor L, class F>
auto LandmarkMap<L, F>::record() const -> LandmarkMapRecord<Landmark> {
  LandmarkMapRecord<Landmark> record{.numbers = static_cast<std::uint32_t>(landmarks_.size())};
  for_each([&](std::uint32_t number, const MappedLandmark<Landmark>& landmark) {
    auto& last = record.landmarks.emplace_back();
    last.number = number;
    last.landmark = landmark;
    if constexpr (is_placed) last.filed.assign(places_.filed[number].begin(), places_.filed[number].end());
  });
  if constexpr (is_placed) record.widest = places_.widest;
  return record;
}

template <LandmarkSensor L, class F>
auto LandmarkMap<L, F>::restored(const LandmarkMapRecord<Landmark>& record) const -> LandmarkMap {
  LandmarkMap map(*this);
  map.landmarks_ = {};
  map.places_ = {};
  map.size_ = 0;
  if (record.numbers > most_identity) raise("LandmarkMap: expected a record of fewer numbers");
  if (record.numbers > 0) static_cast<void>(map.landmarks_.write(record.numbers - 1));
  std::uint32_t least = 0;
  for (const auto& [number, landmark, filed] : record.landmarks) {
    if (number < least || number >= record.numbers) raise("LandmarkMap: expected numbers that grow");
    least = number + 1;
    if (landmark.sightings == 0 || !std::isfinite(landmark.log_odds))
      raise("LandmarkMap: expected landmarks that have been seen, with finite odds");
    static_cast<void>(Gaussian<Landmark>::checked(landmark.belief.mean, landmark.belief.covariance));
    if (!detail::finite_state(landmark.belief.mean)) raise("LandmarkMap: expected finite landmarks");
    map.landmarks_.write(number) = landmark;
    ++map.size_;
    map.file_at(number, filed);
  }
  if constexpr (is_placed) {
    if (!(record.widest <= std::numeric_limits<double>::max()))
      raise("LandmarkMap: expected a finite standard deviation");
    map.places_.widest = std::max(map.places_.widest, record.widest);
  }
  return map;
}

/// As file() left it.
template <LandmarkSensor L, class F>
void LandmarkMap<L, F>::file_at(std::uint32_t number, const std::vector<double>& filed) {
  if (filed.size() != static_cast<std::size_t>(places))
    raise("LandmarkMap: expected as many numbers of where a landmark is filed as of its place");
  if constexpr (is_placed) {
    const Gaussian<Landmark>& belief = find(number)->belief;
    auto& at = places_.filed.write(number);
    for (int a = 0; a < places; ++a) {
      const auto i = static_cast<std::size_t>(a);
      at[i] = filed[i];
      if (!(std::abs(static_cast<double>(belief.mean(a)) - at[i]) <= options().filing_distance))
        raise("LandmarkMap: expected landmarks near where they are filed");
      places_.widest = std::max(places_.widest, std::sqrt(static_cast<double>(belief.covariance(a, a))));
    }
    places_.tree.insert(at, number);
  }
}

template <LandmarkSensor L, class F>
void LandmarkMap<L, F>::update(const Pose& x, const Measurement& z, std::uint32_t number) {
  MappedLandmark<Landmark>& landmark = landmarks_.write(number);
  const auto& model = detail::model_of(common_->sensor, z);
  const auto in =
      F{}.update(landmark.belief, detail::HeldSensor<Model>{model, x}, detail::measured<L>(model, z));
  if (!in.accepted()) return;
  if constexpr (requires(const L& l) { l.note(landmark.belief.mean, x, z); })
    common_->sensor.note(landmark.belief.mean, x, z);
  ++landmark.sightings;
  landmark.log_odds =
      std::min(landmark.log_odds + gained_odds(x, landmark.belief.mean), options().most_log_odds);
  file(number, false);
}

/// The landmark that this sighting alone says: covariance (H_m^T R^-1 H_m)^-1. Nothing where it does not
/// determine one.
template <LandmarkSensor L, class F>
std::optional<Gaussian<typename LandmarkMap<L, F>::Landmark>> LandmarkMap<L, F>::seen_first(
    const Pose& x, const Measurement& z) const {
  Gaussian<Landmark> landmark{common_->sensor.initialise(x, z), {}};
  const auto& model = detail::model_of(common_->sensor, z);
  const auto h = detail::dense_of(model.part_jacobian(x, landmark.mean));
  const CovarianceOf<Report> r = detail::dense_of(model.noise(x, landmark.mean));
  const Cholesky<dof<Report>> root(r);
  if (!root.good() || !all_finite(h) || !detail::finite_state(landmark.mean)) return std::nullopt;
  const auto white = root.whiten(h);
  const Cholesky<dof<Landmark>> information(symmetrised(CovarianceOf<Landmark>(white.transpose() * white)));
  if (!information.good()) return std::nullopt;
  landmark.covariance = information.inverse();
  return landmark;
}

/// The number of the landmark that begins with this sighting; nothing where none does.
template <LandmarkSensor L, class F>
std::optional<std::uint32_t> LandmarkMap<L, F>::add(const Pose& x, const Sighting& sighting) {
  const auto landmark = seen_first(x, sighting.z);
  if (!landmark) return std::nullopt;
  const auto number = sighting.identity.value_or(static_cast<std::uint32_t>(landmarks_.size()));
  if (find(number) != nullptr) return std::nullopt;  // named twice in one observation
  landmarks_.write(number) = {*landmark, std::min(gained_odds(x, landmark->mean), options().most_log_odds),
                              1};
  ++size_;
  file(number, true);
  return number;
}

template <LandmarkSensor L, class F>
void LandmarkMap<L, F>::remove(std::uint32_t number) {
  if constexpr (is_placed) places_.tree.erase(places_.filed[number], number);
  landmarks_.write(number).sightings = 0;
  --size_;
}

template <LandmarkSensor L, class F>
void LandmarkMap<L, F>::file(std::uint32_t number, bool is_new) {
  if constexpr (is_placed) {
    const Gaussian<Landmark>& belief = find(number)->belief;
    typename SharedKdTree<places>::Point at;
    bool moved = is_new;
    for (int a = 0; a < places; ++a) {
      const auto i = static_cast<std::size_t>(a);
      at[i] = static_cast<double>(belief.mean(a));
      moved = moved || std::abs(at[i] - places_.filed[number][i]) > options().filing_distance;
      places_.widest = std::max(places_.widest, std::sqrt(static_cast<double>(belief.covariance(a, a))));
    }
    if (!moved) return;
    if (!is_new) places_.tree.erase(places_.filed[number], number);
    places_.tree.insert(at, number);
    places_.filed.write(number) = at;
  }
}

/// What a sighting adds to the log odds: how much more likely it is of a landmark than of none.
template <LandmarkSensor L, class F>
double LandmarkMap<L, F>::gained_odds(const Pose& x, const Landmark& m) const {
  double detected = 0;
  if constexpr (requires(const L& l) { l.detection_probability(x, m); })
    detected = common_->sensor.detection_probability(x, m);
  return std::max(options().seen, std::log(detected / options().false_share));
}

/// Whatever was surely in view and not seen is less likely to be there.
template <LandmarkSensor L, class F>
void LandmarkMap<L, F>::miss(const Pose& x, const Choice& seen) {
  if constexpr (requires(const L& l, const Landmark& m) { l.detection_probability(x, m); }) {
    for (const std::uint32_t number : in_view(x)) {
      if (std::find(seen.begin(), seen.end(), number) != seen.end()) continue;
      const MappedLandmark<Landmark>& landmark = *find(number);
      const double detected = certain_detection(x, landmark.belief);
      if (detected <= options().false_share) continue;
      const double odds =
          landmark.log_odds + std::log((1 - std::min(detected, 0.999)) / (1 - options().false_share));
      if (odds < options().remove_below)
        remove(number);
      else
        landmarks_.write(number).log_odds = odds;
    }
  }
}

template <LandmarkSensor L, class F>
std::vector<std::uint32_t> LandmarkMap<L, F>::in_view(const Pose& x) const {
  std::vector<std::uint32_t> numbers;
  if constexpr (is_placed && requires(const L& l) {
                  l.reach();
                  x.translation();
                }) {
    typename SharedKdTree<places>::Point low, high;
    for (int a = 0; a < places; ++a) {
      const double half = common_->sensor.reach() + options().filing_distance;
      low[static_cast<std::size_t>(a)] = x.translation()(a) - half;
      high[static_cast<std::size_t>(a)] = x.translation()(a) + half;
    }
    places_.tree.for_each_in_box(low, high, [&](std::uint32_t n, const auto&) { numbers.push_back(n); });
    std::sort(numbers.begin(), numbers.end());
  } else {
    for_each([&](std::uint32_t n, const auto&) { numbers.push_back(n); });
  }
  return numbers;
}

/// The least probability of detection over the mean and the ends of a standard deviation along each axis: at
/// the rim of the field of view nothing is certain.
template <LandmarkSensor L, class F>
double LandmarkMap<L, F>::certain_detection(const Pose& x, const Gaussian<Landmark>& landmark) const {
  double least = common_->sensor.detection_probability(x, landmark.mean);
  for (int a = 0; a < dof<Landmark>; ++a)
    for (const double sign : {-1.0, 1.0}) {
      if (!(least > 0)) return 0;
      Tangent<Landmark> d = Tangent<Landmark>::Zero();
      d(a) = sign * std::sqrt(landmark.covariance(a, a));
      least = std::min(least, common_->sensor.detection_probability(x, retract(landmark.mean, d)));
    }
  return least;
}

}}  // namespace cairn::CAIRN_ABI
