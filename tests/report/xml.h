#pragma once
#include <algorithm>
#include <cctype>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace weft::test {

/// A strict reader of the XML that the plots use (elements, attributes, text, the five entities and
/// numeric references): anything else throws, so that a document that it reads is well formed.
struct XmlElement {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::string text;  ///< its own, without that of its children
  std::vector<XmlElement> children;

  double number(const std::string& key) const { return std::stod(attributes.at(key)); }
  bool has_class(const std::string& name_of_class) const {
    const auto found = attributes.find("class");
    if (found == attributes.end()) return false;
    std::istringstream names(found->second);
    return std::find(std::istream_iterator<std::string>(names), {}, name_of_class) !=
           std::istream_iterator<std::string>();
  }
  std::vector<const XmlElement*> all(const std::string&) const&& = delete;  ///< would dangle
  /// All descendants with the class, in document order.
  std::vector<const XmlElement*> all(const std::string& name_of_class) const& {
    std::vector<const XmlElement*> found;
    collect(name_of_class, found);
    return found;
  }

 private:
  void collect(const std::string& name_of_class, std::vector<const XmlElement*>& found) const {
    for (const XmlElement& child : children) {
      if (child.has_class(name_of_class)) found.push_back(&child);
      child.collect(name_of_class, found);
    }
  }
};

class XmlReader {
 public:
  static XmlElement read(std::string_view text) {
    XmlReader reader(text);
    reader.skip_space();
    XmlElement root = reader.element();
    reader.skip_space();
    if (!reader.rest_.empty()) reader.fail("text after the root element");
    return root;
  }

 private:
  explicit XmlReader(std::string_view text) : rest_(text) {}

  [[noreturn]] void fail(const std::string& reason) const {
    throw std::runtime_error(reason + " at: " + std::string(rest_.substr(0, 60)));
  }
  bool accept(std::string_view token) {
    if (!rest_.starts_with(token)) return false;
    rest_.remove_prefix(token.size());
    return true;
  }
  void expect(std::string_view token) {
    if (!accept(token)) fail("expected " + std::string(token));
  }
  void skip_space() {
    while (!rest_.empty() && std::isspace(static_cast<unsigned char>(rest_.front()))) {
      rest_.remove_prefix(1);
    }
  }
  std::string name() {
    std::size_t length = 0;
    while (length < rest_.size() &&
           (std::isalnum(static_cast<unsigned char>(rest_[length])) || rest_[length] == '-')) {
      ++length;
    }
    if (length == 0) fail("expected a name");
    std::string result(rest_.substr(0, length));
    rest_.remove_prefix(length);
    return result;
  }
  /// Text up to one of `ends`, entities replaced.
  std::string characters(std::string_view ends) {
    static const std::map<std::string, std::string> kEntities = {
        {"amp", "&"}, {"lt", "<"}, {"gt", ">"}, {"quot", "\""}, {"#39", "'"}};
    std::string result;
    while (!rest_.empty() && ends.find(rest_.front()) == std::string_view::npos) {
      const char c = rest_.front();
      if (c == '<' || (static_cast<unsigned char>(c) < 0x20 && !std::isspace(c)))
        fail("stray character");
      rest_.remove_prefix(1);
      if (c != '&') {
        result += c;
        continue;
      }
      const std::size_t end = rest_.find(';');
      const auto entity = kEntities.find(std::string(rest_.substr(0, end)));
      if (end == std::string_view::npos || entity == kEntities.end()) fail("unknown entity");
      result += entity->second;
      rest_.remove_prefix(end + 1);
    }
    return result;
  }
  XmlElement element() {
    XmlElement result;
    expect("<");
    result.name = name();
    for (;;) {
      const bool space = !rest_.empty() && std::isspace(static_cast<unsigned char>(rest_.front()));
      skip_space();
      if (accept("/>")) return result;
      if (accept(">")) break;
      if (!space) fail("expected a space before an attribute");
      const std::string key = name();
      expect("=\"");
      if (!result.attributes.emplace(key, characters("\"")).second) fail("attribute given twice");
      expect("\"");
    }
    for (;;) {
      result.text += characters("<");
      if (accept("</")) break;
      result.children.push_back(element());
    }
    if (name() != result.name) fail("end of another element than " + result.name);
    expect(">");
    return result;
  }

  std::string_view rest_;
};

}  // namespace weft::test
