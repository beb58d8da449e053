// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Measurements that come late, out of order, or not at all: a filter over moments instead of over calls.
///
/// ```cpp
/// using Track = cairn::Timeline<cairn::Extended, cairn::Unicycle, cairn::RangeBearing, cairn::Compass>;
/// Track timeline(cairn::Extended{}, cairn::Unicycle{}, prior, 0.0, u, /*horizon*/ 2.0);
/// status = timeline.steer(turning, 1.0);                          // the control from 1.0 s on
/// const auto newest = timeline.measure(compass, heading, 1.4);
/// const auto late = timeline.measure(beacon, z, 1.1);             // 1.4 s is taken back and done again
/// const std::optional<cairn::Gaussian<cairn::SE2>> later = timeline.at(1.5);
/// ```
/// Any filter of filter.hpp may take the place of Extended; its form of belief is kept.
///
/// The beliefs after the events of the last `horizon` seconds are kept; what comes late is put in its place
/// and the events after it are repeated, so the belief is exactly that of the filter that got everything in
/// order (with a prediction to every event's moment), whatever the models. O(events after it); O(1) in order.
#pragma once

#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A belief in time under one process and the sensors H. Allocates; not safe for concurrent use.
template <class Filter, class F, class... H>
  requires(ProcessModel<F> || detail::explain_process<F>) &&
          ((MeasurementModel<H> || detail::explain_sensor<H>) && ...)
class Timeline {
public:
  using State = typename F::State;
  using Control = typename F::Control;
  using Belief = BeliefOf<Filter, State>;
  static_assert(detail::demand_one_belief<Filter, Belief, F>());

  /// The belief `prior` at `time` [s], `control` from then on; events may come up to `horizon` [s] late.
  Timeline(const Filter& filter, const F& process, const Belief& prior, double time, const Control& control,
           double horizon)
      : filter_(filter), process_(process), horizon_(horizon), base_{time, control, prior} {
    CAIRN_EXPECTS(horizon >= 0.0 && time - time == 0.0, "a Timeline needs a finite time and a horizon >= 0");
    CAIRN_EXPECTS(finite_control(control), "a Timeline needs a finite control");
  }

  /// The control is u from `time` until the next such event. Refused: as measure(), where a prediction is, or
  /// where u is not finite, which would have every later prediction refused.
  template <class U = Control>
  Status steer(const U& u, double time) {
    const detail::Given<Control, U> given(u);
    if (given.misfit()) return Status::size_mismatch;
    if (!finite_control(given.value())) return Status::not_finite;
    if constexpr (requires { requires Control::SizeAtCompileTime == dynamic; }) {
      Belief here = base_.after;  // what the process says of its size, before it is remembered
      const Status status = filter_.predict(here, process_, 0.0, given.value());
      if (status == Status::size_mismatch) return status;
    }
    return insert(Event({time, given.value(), base_.after}, Steering{}));
  }

  /// Takes in z of `time` and repeats what came after. Refused, and nothing changed: too_old before the
  /// horizon, and what the filter refuses at that moment. A gated measurement is remembered: what comes later
  /// for an earlier moment may let it in.
  template <class Sensor, class V = typename Sensor::Measurement>
    requires((std::same_as<Sensor, H> || ...) || detail::explain_listed<Sensor>)
  auto measure(const Sensor& sensor, const V& z, double time) {
    using Result =
        decltype(filter_.update(base_.after, sensor, std::declval<typename Sensor::Measurement>()));
    const detail::Given<typename Sensor::Measurement, V> given(z);
    Result innovation{};
    innovation.status = given.misfit() ? Status::size_mismatch : accepts(time);
    if (innovation.status != Status::accepted) return innovation;
    const Moment& last = before(place(time));
    Moment now{time, last.control, last.after};
    innovation.status = advance(now, last.time);
    if (innovation.status != Status::accepted) return innovation;
    innovation = filter_.update(now.after, sensor, given.value());
    if (!innovation.accepted() && innovation.status != Status::gated) return innovation;
    const Status status = insert(Event(now, Sighting<Sensor>{sensor, given.value()}));
    if (status != Status::accepted) innovation.status = status;
    return innovation;
  }

  /// Moment of the last event [s], or of the prior.
  [[nodiscard]] double time() const noexcept { return before(events_.size()).time; }
  /// The belief after the last event.
  [[nodiscard]] const Belief& belief() const noexcept { return before(events_.size()).after; }
  /// Number of events remembered.
  [[nodiscard]] std::size_t size() const noexcept { return events_.size(); }

  /// The belief at `time` from all events up to it; nothing before the horizon, or where the prediction is
  /// refused.
  [[nodiscard]] std::optional<Belief> at(double time) const {
    if (accepts(time) != Status::accepted) return std::nullopt;
    const Moment& last = before(place(time));
    Moment now{time, last.control, last.after};
    if (advance(now, last.time) != Status::accepted) return std::nullopt;
    return now.after;
  }

private:
  struct Moment {
    double time;
    Control control;  ///< from then on
    Belief after;
  };
  struct Steering {};
  template <class Sensor>
  struct Sighting {
    Sensor sensor;
    typename Sensor::Measurement z;
  };
  struct Event : Moment {
    std::variant<Steering, Sighting<H>...> what;
    Event(const Moment& moment, std::variant<Steering, Sighting<H>...> happened)
        : Moment(moment), what(std::move(happened)) {}
  };

  /// As far as one can tell: a control may be of any type.
  [[nodiscard]] static bool finite_control(const Control& control) {
    if constexpr (Manifold<Control>)
      return detail::finite_state(control);
    else if constexpr (requires { control.allFinite(); })
      return control.allFinite();
    else
      return true;
  }
  [[nodiscard]] Status accepts(double time) const {
    if (!(time - time == 0.0)) return Status::bad_time_step;
    const bool known = time >= base_.time && time >= this->time() - horizon_;
    return known ? Status::accepted : Status::too_old;
  }
  /// Index of the first event after `time`.
  [[nodiscard]] std::size_t place(double time) const {
    std::size_t i = events_.size();
    while (i > 0 && events_[i - 1].time > time) --i;
    return i;
  }
  [[nodiscard]] const Moment& before(std::size_t i) const noexcept {
    return i == 0 ? base_ : static_cast<const Moment&>(events_[i - 1]);
  }
  /// Moves now.after from `since` to now.time. Events of one moment have no step between them.
  Status advance(Moment& now, double since) const {
    if (now.time == since) return Status::accepted;
    return filter_.predict(now.after, process_, now.time - since, now.control);
  }

  Status insert(Event event) {
    const Status allowed = accepts(event.time);
    if (allowed != Status::accepted) return allowed;
    const std::size_t first = place(event.time);
    std::vector<Moment> redone;
    const Status status = repeat(event, first, redone);
    if (status != Status::accepted) return status;
    events_.insert(events_.begin() + static_cast<std::ptrdiff_t>(first), std::move(event));
    for (std::size_t k = 0; k < redone.size(); ++k) static_cast<Moment&>(events_[first + k]) = redone[k];
    forget();
    return Status::accepted;
  }

  /// The moments of `event` and of all from `first` on, as they are once it is known.
  Status repeat(const Event& event, std::size_t first, std::vector<Moment>& redone) const {
    redone.reserve(events_.size() - first + 1);
    Moment last = before(first);
    bool steered = false;  // by a later event, from which on the controls are known
    for (std::size_t k = first; k <= events_.size(); ++k) {
      const Event& next = k == first ? event : events_[k - 1];
      const bool steers = std::holds_alternative<Steering>(next.what);
      steered = steered || (k != first && steers);
      Moment now{next.time, last.control, last.after};
      const Status status = advance(now, last.time);
      if (status != Status::accepted) return status;
      if (steers || steered) now.control = next.control;
      apply(next, now.after);
      redone.push_back(now);
      last = now;
    }
    return Status::accepted;
  }

  void apply(const Event& event, Belief& belief) const {
    std::visit(
        [&](const auto& what) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(what)>, Steering>)
            static_cast<void>(filter_.update(belief, what.sensor, what.z));
        },
        event.what);
  }

  /// Events older than the horizon become the base.
  void forget() {
    const double oldest = time() - horizon_;
    std::size_t count = 0;
    while (count < events_.size() && events_[count].time < oldest) ++count;
    if (count == 0) return;
    base_ = static_cast<const Moment&>(events_[count - 1]);
    events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(count));
  }

  Filter filter_;
  F process_;
  double horizon_;
  Moment base_;
  std::vector<Event> events_;
};

}}  // namespace cairn::CAIRN_ABI
