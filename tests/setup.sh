#!/usr/bin/env bash
# Makes sure that there is a Vulkan driver; on Debian and Ubuntu it is installed when there is none.
set -euo pipefail
have_driver() { compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null; }
have_loader() { ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1'; }
if [ "$(uname)" != Linux ] || { have_driver && have_loader; } || [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]; then exit 0; fi
if ! command -v apt-get >/dev/null; then
    echo "No Vulkan driver was found. Install your GPU's driver, or Mesa's software renderer (lavapipe)." >&2
    exit 2
fi
sudo=; [ "$(id -u)" = 0 ] || sudo=sudo
echo "No Vulkan driver was found: installing Mesa's software renderer (mesa-vulkan-drivers, libvulkan1)."
export DEBIAN_FRONTEND=noninteractive
$sudo apt-get update -qq
$sudo apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1 gcc g++ >/dev/null
