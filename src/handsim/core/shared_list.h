// A list whose copies share their items until one of them changes: a copy costs no memory and next to no
// time, and a list that equals another one is often seen to be the very same.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <initializer_list>
#include <utility>

namespace handsim {

/// @tparam C std::vector or std::list; its items may be incomplete here. Access that may change items makes
/// them the list's own. References into a list are valid as those of C, up to a change after a copy.
template <class C>
class SharedList {
 public:
  using value_type = typename C::value_type;
  using iterator = typename C::iterator;
  using const_iterator = typename C::const_iterator;

  SharedList() = default;
  SharedList(std::initializer_list<value_type> items) : content_(new Content{C(items)}) {}
  SharedList(const SharedList& other) : content_(other.content_) {
    if (content_) content_->owners.fetch_add(1, std::memory_order_relaxed);
  }
  SharedList(SharedList&& other) noexcept : content_(std::exchange(other.content_, nullptr)) {}
  SharedList& operator=(SharedList other) noexcept {
    std::swap(content_, other.content_);
    return *this;
  }
  ~SharedList() {
    if (content_ && content_->owners.fetch_sub(1, std::memory_order_acq_rel) == 1) delete content_;
  }

  /// True if both share their items, or have none.
  bool is(const SharedList& other) const { return content_ == other.content_ || (empty() && other.empty()); }

  bool empty() const { return !content_ || content_->items.empty(); }
  std::size_t size() const { return content_ ? content_->items.size() : 0; }
  const_iterator begin() const { return items().begin(); }
  const_iterator end() const { return items().end(); }
  const value_type& front() const { return items().front(); }
  const value_type& back() const { return items().back(); }
  const value_type& operator[](std::size_t i) const { return items()[i]; }

  iterator begin() { return own().begin(); }
  iterator end() { return own().end(); }
  value_type& front() { return own().front(); }
  value_type& back() { return own().back(); }
  value_type& operator[](std::size_t i) { return own()[i]; }
  void push_back(value_type item) { own().push_back(std::move(item)); }
  template <class... Args>
  value_type& emplace_back(Args&&... args) {
    return own().emplace_back(std::forward<Args>(args)...);
  }
  void pop_back() { own().pop_back(); }
  iterator erase(const_iterator at) { return own().erase(at); }
  template <class Test>
  void remove_if(Test test) {
    if (std::ranges::any_of(items(), test)) std::erase_if(own(), test);
  }
  void clear() { *this = {}; }

 private:
  struct Content {
    C items;
    std::atomic<long> owners = 1;
  };

  const C& items() const {
    static const C kNone;
    return content_ ? content_->items : kNone;
  }
  C& own() {
    if (!content_)
      content_ = new Content{};
    else if (content_->owners.load(std::memory_order_acquire) != 1)
      *this = SharedList(new Content{content_->items});
    return content_->items;
  }
  explicit SharedList(Content* content) : content_(content) {}

  Content* content_ = nullptr;  ///< null: no items
};

}  // namespace handsim
