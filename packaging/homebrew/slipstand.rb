# For a tap of one's own: Homebrew's main one wants each library as a resource of its own.
class Slipstand < Formula
  desc "Measures dry friction on a laboratory shaking stand"
  homepage "@ADDRESS@"
  url "@ADDRESS@/slipstand-@VERSION@.tar.gz"
  sha256 "@SOURCE_SHA256@"
  license "MIT"

  depends_on "python@3.13"

  def install
    system Formula["python@3.13"].opt_bin/"python3.13", "-m", "venv", libexec
    pip = [libexec/"bin/python", "-m", "pip", "install", "--disable-pip-version-check"]
    system(*pip, "--require-hashes", "-r", "requirements.lock")
    system(*pip, "--no-deps", "--no-build-isolation", ".")
    bin.install_symlink libexec/"bin/slipstand"
  end

  test do
    assert_match version.to_s, shell_output("#{bin}/slipstand --version")
    system bin/"slipstand", "simulate", "--series", "1FFM0", "-o", testpath/"run.h5"
    system bin/"slipstand", "analyze", testpath/"run.h5"
  end
end
