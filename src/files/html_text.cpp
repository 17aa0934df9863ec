#include "files/html_text.h"

#include "base/text.h"

namespace tessera {

std::string inHtml(std::string_view text) {
    std::string safe;
    for (const char c : withoutControls(text)) {
        switch (c) {
            case '&':
                safe += "&amp;";
                break;
            case '<':
                safe += "&lt;";
                break;
            case '>':
                safe += "&gt;";
                break;
            case '"':
                safe += "&quot;";
                break;
            case '\'':
                safe += "&#39;";
                break;
            default:
                safe += c;
        }
    }
    return safe;
}

}  // namespace tessera
